# SPDX-License-Identifier: Apache-2.0
"""The hand that holds the haptic device: a mass-damper-spring that feels the feedback."""

import numpy as np
from scipy.linalg import expm

from noninteract_ros.arrays import Array
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference


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
        deviation = self.deviation(force)
        return Reference(
            intended.position + deviation.position,
            intended.velocity + deviation.velocity,
            intended.acceleration + deviation.acceleration,
        )

    @property
    def offset(self) -> tuple[Array, Array]:
        """Deviation of the plain coordinates and its rate, shape (dim,) each [m; m/s]."""
        return self._state[0], self._state[1]

    def deviation(self, force: Array) -> Reference:
        """How the device moves away from the intended motion under a force [N], shape (dim,)."""
        error, error_rate = self._state
        pull = force - self._damping * error_rate - self._stiffness * error
        return Reference(error, error_rate, pull / self._mass)


class TurningHand:
    """A hand that also turns: its deviation has rotation vectors phi, each a mass-damper-spring.

    A torque acts on phi through A(phi)', so that its power on the device's turning is its power
    on phi: the hand stays passive.

    Args:
        place: Hand of the plain coordinates.
        turn: Hand of the rotation vectors, with an inertia for a mass.
        layout: Layout of the device's values.
    """

    def __init__(self, place: Hand, turn: Hand, layout: Layout) -> None:
        self._place, self._turn, self._layout = place, turn, layout

    def reset(self) -> None:
        """Puts the device back on the intended motion."""
        self._place.reset()
        self._turn.reset()

    def advance(self, force: Array, periods: int) -> None:
        """Lets a feedback [N, N m], shape (dim,), act for a number of update periods."""
        self._place.advance(force[self._layout.rates], periods)
        for _ in range(periods):  # A(phi) moves on with phi.
            self._turn.advance(self._torque(force), 1)

    def deflect(self, intended: Reference, force: Array) -> Reference:
        """The device's motion under a feedback [N, N m], shape (dim,), about the intended one."""
        place = self._place.deviation(force[self._layout.rates])
        turn = self._turn.deviation(self._torque(force))
        gap = Reference(
            self._layout.stack_components(place.position, turn.position),
            self._layout.stack_components(place.velocity, turn.velocity),
            self._layout.stack_components(place.acceleration, turn.acceleration),
        )
        return intended.plus(gap, self._layout)

    @property
    def offset(self) -> tuple[Array, Array]:
        """Deviation of the plain coordinates and its rate [m; m/s]."""
        return self._place.offset

    def _torque(self, force: Array) -> Array:
        torque = force[self._layout.angular]
        phi = self._turn.deviation(torque.ravel()).position.reshape(-1, 3)
        return np.einsum("rji,rj->ri", so3.jacobian(phi), torque).ravel()
