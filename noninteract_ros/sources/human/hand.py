# SPDX-License-Identifier: Apache-2.0
"""Operator's hand on the haptic device: a mass-damper-spring under the force feedback."""

import numpy as np
from scipy.linalg import expm

from noninteract_ros.arrays import Array
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference


class Hand:
    """Deviation e of the device from the intended motion, m ë + d ė + k e = f, in each axis.

    The deviation starts at zero, and without a force it stays exactly zero. The force is held
    over an update period; the solution over that period is exact.

    Args:
        mass: m [kg], positive.
        damping: d [N s/m], not negative.
        stiffness: k [N/m], not negative.
        period: Update period [s].
        dim: Number of axes.
    """

    def __init__(
        self, mass: float, damping: float, stiffness: float, period: float, dim: int
    ) -> None:
        self._mass, self._damping, self._stiffness = mass, damping, stiffness
        generator = np.zeros((3, 3))  # Of (e, ė, f) with f held.
        generator[0, 1] = 1.0
        generator[1] = -stiffness / mass, -damping / mass, 1.0 / mass
        self._transition: Array = expm(generator * period)
        self._state = np.zeros((2, dim))

    def reset(self) -> None:
        """Reset the deviation to zero."""
        self._state = np.zeros_like(self._state)

    def advance(self, force: Array, periods: int) -> None:
        """Integrate under a constant force [N], shape (dim,), for a number of update periods."""
        transition = self._transition
        if periods != 1:
            transition = np.linalg.matrix_power(transition, periods)
        self._state = transition[:2, :2] @ self._state + np.outer(transition[:2, 2], force)

    def deflect(self, intended: Reference, force: Array) -> Reference:
        """Return the device's motion about the intended one under a force [N], shape (dim,)."""
        deviation = self.deviation(force)
        return Reference(
            intended.position + deviation.position,
            intended.velocity + deviation.velocity,
            intended.acceleration + deviation.acceleration,
        )

    @property
    def offset(self) -> tuple[Array, Array]:
        """Deviation of the translational coordinates and its rate, shape (dim,) each [m; m/s]."""
        return self._state[0], self._state[1]

    def deviation(self, force: Array) -> Reference:
        """Return the deviation and its derivatives under a force [N], shape (dim,)."""
        error, error_rate = self._state
        pull = force - self._damping * error_rate - self._stiffness * error
        return Reference(error, error_rate, pull / self._mass)


class RotatingHand:
    """Hand with rotations: its deviation has rotation vectors phi, each a mass-damper-spring.

    A torque acts on phi through A(phi)'. So its power on the device's rotation is its power on
    phi, and the hand stays passive.

    Args:
        translation: Hand of the translational coordinates.
        rotation: Hand of the rotation vectors, with an inertia as its mass.
        layout: Layout of the device's values.
    """

    def __init__(self, translation: Hand, rotation: Hand, layout: Layout) -> None:
        self._translation, self._rotation, self._layout = translation, rotation, layout

    def reset(self) -> None:
        """Reset the deviation to zero."""
        self._translation.reset()
        self._rotation.reset()

    def advance(self, force: Array, periods: int) -> None:
        """Integrate under a constant feedback [N, N m], shape (dim,), for some update periods."""
        self._translation.advance(force[self._layout.rates], periods)
        for _ in range(periods):  # A(phi) changes with phi.
            self._rotation.advance(self._torque(force), 1)

    def deflect(self, intended: Reference, force: Array) -> Reference:
        """Return the device's motion about the intended one under a feedback, shape (dim,)."""
        translation = self._translation.deviation(force[self._layout.rates])
        rotation = self._rotation.deviation(self._torque(force))
        gap = Reference(
            self._layout.stack_components(translation.position, rotation.position),
            self._layout.stack_components(translation.velocity, rotation.velocity),
            self._layout.stack_components(translation.acceleration, rotation.acceleration),
        )
        return intended.plus(gap, self._layout)

    @property
    def offset(self) -> tuple[Array, Array]:
        """Deviation of the translational coordinates and its rate [m; m/s]."""
        return self._translation.offset

    def _torque(self, force: Array) -> Array:
        torque = force[self._layout.angular]
        phi = self._rotation.deviation(torque.ravel()).position.reshape(-1, 3)
        return np.einsum("rji,rj->ri", so3.jacobian(phi), torque).ravel()
