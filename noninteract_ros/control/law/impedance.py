# SPDX-License-Identifier: Apache-2.0
"""Impedance of the subtasks: potential, damping and desired inertia of (29) and (30)."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import key
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.subtask import Subtask


@dataclass(frozen=True)
class ImpedanceSettings:
    """Configuration of one subtask's impedance.

    Each list has one number for all coordinates, one per axis of an element, or one per axis of
    each element. A rotation has one number, after those of its element's axes: only for the same
    stiffness about all axes is its torque the exact gradient of a potential.
    """

    stiffness: tuple[float, ...] = key("Stiffness [N/m; N m/rad]", minimum=0.0, live=True)
    damping: tuple[float, ...] = key("Damping [N s/m; N m s/rad]", positive=True, live=True)
    inertia: tuple[float, ...] = key(
        "Desired inertia, remark 2 [kg; kg m^2]; by default that of the team, M_i = S_i' M S_i",
        (),
        positive=True,
        live=True,
    )
    potential: str = key(
        "Shape of the potential: linear, or saturating, which bounds each coordinate's force, and"
        " each rotation's torque, by max_force",
        "linear",
        choices=("linear", "saturating"),
    )
    max_force: tuple[float, ...] = key(
        "Force bound of a saturating potential [N; N m]", (), positive=True, live=True
    )
    force: tuple[float, ...] = key(
        "Desired contact force, in addition to the impedance [N; N m]; by default none",
        (),
        live=True,
    )
    force_gain: tuple[float, ...] = key(
        "Rate of the regulation of the measured force to `force` [1/s]; by default none",
        (),
        minimum=0.0,
        live=True,
    )
    force_bound: tuple[float, ...] = key(
        "Bound of the force added by the regulation [N; N m]", (10.0,), positive=True, live=True
    )


def _empty() -> Array:
    return np.zeros(0)


@dataclass(frozen=True, slots=True)
class Impedance:
    """Stacked gains of all subtasks.

    Attributes:
        stiffness: K, diagonal, shape (n,) [N/m].
        damping: D, diagonal, shape (n,) [N s/m].
        max_force: Bound of each coordinate's spring force, shape (n,) [N]; inf where linear.
        inertias: Desired inertia of each subtask, shape (p_i,) [kg], or None for its own.
        rotations: Coordinates of the rotations, shape (r, 3); None without any. Those of one
            rotation have the same stiffness and bound, and a potential of the angle |e|, whose
            gradient is exact, see `Layout`.
        goal: Desired force, shape (n,) [N]; empty without any.
        goal_gain: Rates of the force regulation, shape (n,) [1/s].
        goal_bound: Bounds of the regulation's output, shape (n,) [N].
        linear: True if no force is bounded; then the same results are computed faster.
    """

    stiffness: Array
    damping: Array
    max_force: Array
    inertias: tuple[Array | None, ...]
    rotations: Array | None = None
    goal: Array = field(default_factory=_empty)
    goal_gain: Array = field(default_factory=_empty)
    goal_bound: Array = field(default_factory=_empty)
    linear: bool = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "linear", bool(np.isinf(self.max_force).all()))

    def force(self, e: Array) -> Array:
        """Return h(e), the exact gradient of the potential, shape (n,) [N; N m]."""
        linear = self.stiffness * e
        return linear if self.linear else linear / np.sqrt(1.0 + self._overload(linear))

    def feedback(self, e: Array, e_rate: Array) -> Array:
        """Return D e_rate + h(e), shape (n,) [N; N m]."""
        return self.damping * e_rate + self.force(e)

    def potential(self, e: Array) -> Array:
        """Return V(e) by coordinate, shape (n,) [J]: K e^2 / 2 if linear.

        A saturating potential is F^2/K (sqrt(1 + (K e / F)^2) - 1), written so that F = inf is the
        linear case. The three coordinates of a rotation have the angle |e| under the root, and add
        up to its potential.
        """
        linear = self.stiffness * e
        if self.linear:
            return 0.5 * linear * e
        return linear * e / (1.0 + np.sqrt(1.0 + self._overload(linear)))

    def _overload(self, linear: Array) -> Array:
        """Return the squared ratio of force to bound, where a rotation has its torque's norm."""
        square = (linear / self.max_force) ** 2
        if self.rotations is not None:
            square[self.rotations] = square[self.rotations].sum(axis=1, keepdims=True)
        return square


def stack_impedance(
    subtasks: Sequence[Subtask], settings: Sequence[ImpedanceSettings]
) -> Impedance:
    """Stack the settings of all subtasks.

    Raises:
        ScenarioError: A list of numbers does not fit its subtask.
    """
    pairs = list(zip(subtasks, settings, strict=True))

    def stacked(name: str) -> Array:
        parts = [_or_zero(task, name, getattr(item, name)) for task, item in pairs]
        return np.concatenate(parts)

    return Impedance(
        stiffness=np.concatenate(
            [per_coordinate(task, "stiffness", item.stiffness) for task, item in pairs]
        ),
        damping=np.concatenate(
            [per_coordinate(task, "damping", item.damping) for task, item in pairs]
        ),
        max_force=np.concatenate([_max_force(task, item) for task, item in pairs]),
        inertias=tuple(
            per_coordinate(task, "inertia", item.inertia) if item.inertia else None
            for task, item in pairs
        ),
        rotations=_rotations(subtasks),
        goal=stacked("force"),
        goal_gain=stacked("force_gain"),
        goal_bound=stacked("force_bound"),
    )


def _or_zero(subtask: Subtask, name: str, values: Sequence[float]) -> Array:
    return per_coordinate(subtask, name, values) if values else np.zeros(subtask.dim)


def _rotations(subtasks: Sequence[Subtask]) -> Array | None:
    layout = Layout.joined([task.layout for task in subtasks])
    return layout.angular if layout.rotates else None


def _max_force(subtask: Subtask, settings: ImpedanceSettings) -> Array:
    if settings.potential == "linear":
        return np.full(subtask.dim, np.inf)
    return per_coordinate(subtask, "max_force", settings.max_force)


def per_coordinate(subtask: Subtask, name: str, values: Sequence[float]) -> Array:
    """Expand numbers to one per coordinate of a subtask, shape (p,).

    Args:
        subtask: The subtask.
        name: Key of the numbers, for error messages.
        values: One number for all coordinates; or one per axis of an element, followed by one for
            its rotation, if any; or the same for each element.

    Raises:
        ScenarioError: Any other count.
    """
    parts = (*subtask.axes, "rotation") if subtask.rotates else subtask.axes
    total = len(parts) * len(subtask.elements)
    if len(values) not in (1, len(parts), total):
        counts = " or ".join(str(count) for count in sorted({1, len(parts), total}))
        allowed = f"{counts} numbers"
        if subtask.rotates:
            allowed += f" ({', '.join(parts)} of each element)"
        raise ScenarioError(f"{subtask.name}.{name}", list(values), allowed)
    numbers = np.resize(np.array(values), (len(subtask.elements), len(parts)))
    if subtask.rotates:
        numbers = np.hstack([numbers, numbers[:, -1:], numbers[:, -1:]])
    return numbers.ravel()
