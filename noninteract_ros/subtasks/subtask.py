# SPDX-License-Identifier: Apache-2.0
"""Interface of a subtask: definition 1, equations (4) to (6)."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.subtasks.components import Component
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.mixing import Mixing
from noninteract_ros.team.team import TeamState


@dataclass(frozen=True, slots=True)
class SubtaskState:
    """Value and differential of one subtask, or of several stacked ones.

    Attributes:
        x: Value phi(q), shape (size,).
        J: Jacobian, shape (p, n): dx/dt = J v, with the angular velocity for rotations.
        J_rate: Time derivative of the Jacobian, shape (p, n).
    """

    x: Array
    J: Array
    J_rate: Array


class Subtask(ABC):
    """Smooth map from the team's configuration to the coordinates of one goal.

    A value lists the elements; each has its positions along the axes, followed by a quaternion
    (x, y, z, w) if the subtask rotates. The velocity of a quaternion is the angular velocity.

    Attributes:
        name: Name in the scenario; prefix of the topics.
        elements: Names of the bodies or edges in messages, in order.
        axes: Axes of each element, out of x, y and z.
        rotates: True if each element has a rotation.
        angles: True if positions are angles [rad], equal up to full turns.
        frame: Orientation of the team that other subtasks can use as reference frame, or None; a
            component with one rotation.
        mixing: Structure of the subtask, see `mixing`; None if undeclared.
        dim: Dimension p of a velocity.
        size: Dimension of a value.
    """

    name: str
    elements: tuple[str, ...]
    axes: tuple[str, ...]
    rotates: bool = False
    angles: bool = False
    frame: Component | None = None
    mixing: Mixing | None = None

    @cached_property
    def layout(self) -> Layout:
        """Layout of a value: positions and quaternions."""
        count = len(self.elements)
        return Layout((len(self.axes),) * count, (self.rotates,) * count, (self.angles,) * count)

    @property
    def element_units(self) -> tuple[str, ...]:
        """Unit of the positions of each element."""
        return ("rad" if self.angles else "m",) * len(self.elements)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Unit of each coordinate of an error, shape (p,); rad for rotations."""
        units = np.full(self.dim, "rad")
        units[self.layout.rates] = np.repeat(self.element_units, len(self.axes))
        return tuple(units.tolist())

    def magnitudes(self, e: Array) -> dict[str, Array]:
        """Return the magnitudes of errors e, shape (..., p), by unit, shape (..., k) each.

        The magnitude is the Euclidean norm of an element's positions, and the angle of a rotation.
        """
        lengths = e[..., self.layout.rates].reshape(*e.shape[:-1], -1, max(1, len(self.axes)))
        angles = np.linalg.norm(e[..., self.layout.angular], axis=-1)
        found = {}
        if self.axes:
            norms, units = np.linalg.norm(lengths, axis=-1), np.array(self.element_units)
            found = {unit: norms[..., units == unit] for unit in ("m", "rad") if unit in units}
        if self.rotates:
            found["rad"] = angles  # A subtask with rotations has no angles as positions.
        return found

    @property
    def dim(self) -> int:
        """Dimension of a velocity."""
        return self.layout.dim

    @property
    def size(self) -> int:
        """Dimension of a value."""
        return self.layout.size

    def difference(self, x: Array, x_d: Array) -> Array:
        """Return the error of a value, shape (p,): x - x_d, for rotations log(R R_d')."""
        return self.layout.difference(x, x_d)

    @abstractmethod
    def evaluate(self, state: TeamState) -> SubtaskState:
        """Return value, Jacobian and Jacobian rate at a state of the team."""

    def singularity_distance(self, state: TeamState) -> float:
        """Return the distance from states without a defined value: 0 there, at most 1.

        The regularity of the stack does not reveal a Jacobian that grows without bound there;
        therefore the law also fades out by this measure.
        """
        return 1.0
