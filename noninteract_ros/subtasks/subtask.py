# SPDX-License-Identifier: Apache-2.0
"""What a subtask is: definition 1, equations (4) to (6)."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.mixing import Mixing
from noninteract_ros.subtasks.parts import Part
from noninteract_ros.team.team import TeamState


@dataclass(frozen=True, slots=True)
class SubtaskState:
    """Value and differential of one subtask, or of several stacked ones.

    Attributes:
        x: Value phi(q), shape (size,).
        J: Jacobian, shape (p, n): dx/dt = J v, of rotations the angular velocity.
        J_rate: Its time derivative along the motion, shape (p, n).
    """

    x: Array
    J: Array
    J_rate: Array


class Subtask(ABC):
    """A smooth map from the team's configuration to the coordinates of one goal.

    A value runs over the elements; each has its positions along the axes and then, where the
    subtask rotates, a quaternion (x, y, z, w), whose velocity is the angular velocity.

    Attributes:
        name: Name in the scenario; prefixes its topics.
        elements: Names of the bodies or edges that its messages list, in order.
        axes: Axes, out of x, y and z, that each element has.
        rotates: Whether each element has a rotation.
        angles: Whether positions are angles [rad]: those a whole turn apart are the same.
        frame: Orientation of the team that other subtasks can be seen from, or None; its
            `evaluate` returns one rotation with its differentials, see `parts.Rows`.
        mixing: How it mixes what each robot does, or None; see `mixing`.
        dim: Number of coordinates p of a velocity.
        size: Number of numbers of a value.
    """

    name: str
    elements: tuple[str, ...]
    axes: tuple[str, ...]
    rotates: bool = False
    angles: bool = False
    frame: Part | None = None
    mixing: Mixing | None = None

    @cached_property
    def layout(self) -> Layout:
        """Which numbers of a value are positions and which are quaternions."""
        count = len(self.elements)
        return Layout((len(self.axes),) * count, (self.rotates,) * count, (self.angles,) * count)

    @property
    def element_units(self) -> tuple[str, ...]:
        """Unit of the positions of each element."""
        return ("rad" if self.angles else "m",) * len(self.elements)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Unit of each coordinate, shape (p,): errors of rotations are angles."""
        units = np.full(self.dim, "rad")
        units[self.layout.rates] = np.repeat(self.element_units, len(self.axes))
        return tuple(units.tolist())

    def magnitudes(self, e: Array) -> dict[str, Array]:
        """Sizes of errors e, shape (..., p), by unit, shape (..., k) each.

        Of each element with positions their Euclidean norm, of each rotation its angle.
        """
        lengths = e[..., self.layout.rates].reshape(*e.shape[:-1], -1, max(1, len(self.axes)))
        angles = np.linalg.norm(e[..., self.layout.angular], axis=-1)
        found = {}
        if self.axes:
            norms, units = np.linalg.norm(lengths, axis=-1), np.array(self.element_units)
            found = {unit: norms[..., units == unit] for unit in ("m", "rad") if unit in units}
        if self.rotates:
            found["rad"] = angles  # A subtask that rotates has no positions that are angles.
        return found

    @property
    def dim(self) -> int:
        """Number of coordinates of a velocity."""
        return self.layout.dim

    @property
    def size(self) -> int:
        """Number of numbers of a value."""
        return self.layout.size

    def difference(self, x: Array, x_d: Array) -> Array:
        """Error of a value towards another, shape (p,): x - x_d, for rotations log(R R_d')."""
        return self.layout.difference(x, x_d)

    @abstractmethod
    def evaluate(self, state: TeamState) -> SubtaskState:
        """Value, Jacobian and Jacobian rate at a state of the team."""

    def singularity_distance(self, state: TeamState) -> float:
        """How far the state is from places where the value is not defined: there 0, at most 1.

        A Jacobian that grows beyond bounds there hides from the regularity of the stack; so the
        law fades out by this measure, too.
        """
        return 1.0
