# SPDX-License-Identifier: Apache-2.0
"""Impedance of the subtasks: potentials, damping and desired inertia of (29) and (30)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import key
from noninteract_ros.subtasks.subtask import Subtask


@dataclass(frozen=True)
class ImpedanceSettings:
    """Configuration of one subtask's impedance.

    Each list has one number for all coordinates, one per axis, or one per coordinate.
    """

    stiffness: tuple[float, ...] = key("Stiffness [N/m]", minimum=0.0, live=True)
    damping: tuple[float, ...] = key("Damping [N s/m]", positive=True, live=True)
    inertia: tuple[float, ...] = key(
        "Desired inertia [kg], remark 2; by default the team's own, M_i = S_i' M S_i",
        (),
        positive=True,
        live=True,
    )
    potential: str = key(
        "Shape of the potential; saturating bounds the force of each coordinate by max_force",
        "linear",
        choices=("linear", "saturating"),
    )
    max_force: tuple[float, ...] = key(
        "Bound of a saturating potential's force [N]", (), positive=True, live=True
    )


@dataclass(frozen=True, slots=True)
class Impedance:
    """The gains of all subtasks, stacked.

    Attributes:
        stiffness: K, diagonal, shape (n,) [N/m].
        damping: D, diagonal, shape (n,) [N s/m].
        max_force: Bound of each coordinate's spring force, shape (n,) [N]; inf where linear.
        inertias: Desired inertia of each subtask, shape (p_i,) [kg], or None for its own.
    """

    stiffness: Array
    damping: Array
    max_force: Array
    inertias: tuple[Array | None, ...]

    def force(self, e: Array) -> Array:
        """h(e), the exact gradient of the potential, shape (n,) [N]."""
        linear = self.stiffness * e
        return linear / np.sqrt(1.0 + (linear / self.max_force) ** 2)

    def potential(self, e: Array) -> Array:
        """V(e) by coordinate, shape (n,) [J]: K e^2 / 2 where linear.

        Saturating: F^2/K (sqrt(1 + (K e / F)^2) - 1), written so that F = inf is the linear case.
        """
        linear = self.stiffness * e
        return linear * e / (1.0 + np.sqrt(1.0 + (linear / self.max_force) ** 2))


def stack_impedance(
    subtasks: Sequence[Subtask], settings: Sequence[ImpedanceSettings]
) -> Impedance:
    """Stacks the settings of all subtasks.

    Raises:
        ScenarioError: A list of numbers does not fit its subtask.
    """
    pairs = list(zip(subtasks, settings, strict=True))
    return Impedance(
        np.concatenate([spread(task, "stiffness", item.stiffness) for task, item in pairs]),
        np.concatenate([spread(task, "damping", item.damping) for task, item in pairs]),
        np.concatenate([_max_force(task, item) for task, item in pairs]),
        tuple(
            spread(task, "inertia", item.inertia) if item.inertia else None for task, item in pairs
        ),
    )


def _max_force(subtask: Subtask, settings: ImpedanceSettings) -> Array:
    if settings.potential == "linear":
        return np.full(subtask.dim, np.inf)
    return spread(subtask, "max_force", settings.max_force)


def spread(subtask: Subtask, name: str, values: Sequence[float]) -> Array:
    """Numbers for each coordinate of a subtask, from one, one per axis, or one per coordinate.

    Raises:
        ScenarioError: Any other count.
    """
    axes = len(subtask.axes)
    if len(values) == 1:
        return np.full(subtask.dim, values[0])
    if len(values) == axes:
        return np.tile(values, len(subtask.elements))
    if len(values) == subtask.dim:
        return np.array(values)
    counts = " or ".join(str(count) for count in sorted({1, axes, subtask.dim}))
    raise ScenarioError(f"{subtask.name}.{name}", list(values), f"{counts} numbers")
