# SPDX-License-Identifier: Apache-2.0
"""Reference of one subtask at one time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from noninteract_ros.arrays import Array
from noninteract_ros.subtasks.layout import Layout, ValueMotion


@dataclass(frozen=True, slots=True)
class Reference:
    """Desired motion of one subtask, in its own coordinates (float64, SI units).

    Methods with a layout treat its quaternions as rotations; without one, all numbers are
    scalars.

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
        """Return a reference at rest at a position, shape (size,), which is copied."""
        value = np.array(position, dtype=np.float64)
        dim = value.size if layout is None else layout.dim
        return cls(value, np.zeros(dim), np.zeros(dim))

    def extrapolate(self, dt: float, layout: Layout | None = None) -> "Reference":
        """Return the motion `dt` seconds later, under constant acceleration."""
        return Reference(*(layout or self._scalars).extrapolate(self._motion, dt))

    def minus(self, base: "Reference", layout: Layout) -> "Reference":
        """Return the difference of this motion from another one, all of shape (dim,)."""
        return Reference(*layout.relative_motion(self._motion, base._motion))

    def deviation(self, before: "Reference", dt: float, layout: Layout) -> tuple[Array, Array]:
        """Return position and velocity of `self.minus(before.extrapolate(dt))`, shape (dim,)."""
        return layout.deviation(self._motion, before._motion, dt)

    def plus(self, gap: "Reference", layout: Layout) -> "Reference":
        """Return this motion composed with a difference, all of shape (dim,)."""
        return Reference(*layout.compose_motion(self._motion, gap._motion))

    @property
    def _motion(self) -> ValueMotion:
        return self.position, self.velocity, self.acceleration

    @property
    def _scalars(self) -> Layout:
        return Layout.scalars(self.position.size)
