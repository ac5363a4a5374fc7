# SPDX-License-Identifier: Apache-2.0
"""What a source asks of one subtask at one instant."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from noninteract_ros.arrays import Array


@dataclass(frozen=True, slots=True)
class Reference:
    """Desired motion of one subtask, in its own coordinates (float64, SI units).

    Attributes:
        position: Desired value xᵈ, shape (size,).
        velocity: Desired rate ẋᵈ, shape (dim,).
        acceleration: Desired acceleration ẍᵈ, shape (dim,).
    """

    position: Array
    velocity: Array
    acceleration: Array

    @classmethod
    def still(cls, position: ArrayLike) -> "Reference":
        """Rest at a position of shape (size,), which is copied."""
        held = np.array(position, dtype=np.float64)
        return cls(held, np.zeros_like(held), np.zeros_like(held))

    def at(self, dt: float) -> "Reference":
        """The same motion `dt` seconds later, its acceleration held."""
        return Reference(
            self.position + dt * self.velocity + (0.5 * dt * dt) * self.acceleration,
            self.velocity + dt * self.acceleration,
            self.acceleration,
        )
