# SPDX-License-Identifier: Apache-2.0
"""What a source asks of one subtask at one instant."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from noninteract_ros.arrays import Array
from noninteract_ros.subtasks.layout import Layout, ValueMotion


@dataclass(frozen=True, slots=True)
class Reference:
    """Desired motion of one subtask, in its own coordinates (float64, SI units).

    Layouts say which numbers are quaternions; without one, all are plain.

    Attributes:
        position: Desired value xᵈ, shape (size,).
        velocity: Desired rate ẋᵈ, shape (dim,).
        acceleration: Desired acceleration ẍᵈ, shape (dim,).
    """

    position: Array
    velocity: Array
    acceleration: Array

    @classmethod
    def at_rest(cls, position: ArrayLike, layout: Layout | None = None) -> "Reference":
        """Rest at a position of shape (size,), which is copied."""
        held = np.array(position, dtype=np.float64)
        dim = held.size if layout is None else layout.dim
        return cls(held, np.zeros(dim), np.zeros(dim))

    def extrapolate(self, dt: float, layout: Layout | None = None) -> "Reference":
        """The same motion `dt` seconds later, its acceleration held."""
        return Reference(*(layout or self._plain).extrapolate(self._motion, dt))

    def minus(self, base: "Reference", layout: Layout) -> "Reference":
        """The gap from another motion to this one, all of it of shape (dim,)."""
        return Reference(*layout.relative_motion(self._motion, base._motion))

    def deviation(self, before: "Reference", dt: float, layout: Layout) -> tuple[Array, Array]:
        """Position and velocity of `self.minus(before.at(dt))`, shape (dim,) each."""
        return layout.deviation(self._motion, before._motion, dt)

    def plus(self, gap: "Reference", layout: Layout) -> "Reference":
        """The motion that a gap, all of it of shape (dim,), leads away from this one."""
        return Reference(*layout.compose_motion(self._motion, gap._motion))

    @property
    def _motion(self) -> ValueMotion:
        return self.position, self.velocity, self.acceleration

    @property
    def _plain(self) -> Layout:
        return Layout.scalars(self.position.size)
