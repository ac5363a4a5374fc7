# SPDX-License-Identifier: Apache-2.0
"""The hand that holds the haptic device: a mass-damper-spring that feels the feedback force."""

import numpy as np
from scipy.linalg import expm

from noninteract_ros.arrays import Array
from noninteract_ros.control.reference import Reference


class Hand:
    """Deviation e of the device from the intended motion, m ë + d ė + k e = f, in each axis.

    Without a force the device stays exactly on the intended motion. The force is held over an
    update period, for which the solution is exact.
    """

    def __init__(
        self, mass: float, damping: float, stiffness: float, period: float, dim: int
    ) -> None:
        """Starts on the intended motion.

        Args:
            mass: m [kg], positive.
            damping: d [N s/m], not negative.
            stiffness: k [N/m], not negative.
            period: Update period [s].
            dim: Number of axes.
        """
        self._mass, self._damping, self._stiffness = mass, damping, stiffness
        generator = np.zeros((3, 3))  # of (e, ė, f) with f held
        generator[0, 1] = 1.0
        generator[1] = -stiffness / mass, -damping / mass, 1.0 / mass
        self._transition: Array = expm(generator * period)
        self._state = np.zeros((2, dim))

    def reset(self) -> None:
        """Puts the device back on the intended motion."""
        self._state = np.zeros_like(self._state)

    def advance(self, force: Array, periods: int) -> None:
        """Lets a constant force [N], shape (dim,), act for a number of update periods."""
        transition = self._transition
        if periods != 1:
            transition = np.linalg.matrix_power(transition, periods)
        self._state = transition[:2, :2] @ self._state + np.outer(transition[:2, 2], force)

    def deflect(self, intended: Reference, force: Array) -> Reference:
        """The device's motion under a force [N], shape (dim,), about the intended one."""
        error, error_rate = self._state
        pull = force - self._damping * error_rate - self._stiffness * error
        return Reference(
            intended.position + error,
            intended.velocity + error_rate,
            intended.acceleration + pull / self._mass,
        )
