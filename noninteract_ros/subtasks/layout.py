# SPDX-License-Identifier: Apache-2.0
"""Which numbers of a value are plain and which are quaternions, and how to reckon with them.

A value has `size` numbers and its velocity `dim`: a rotation counts four in the one and three, its
angular velocity, in the other. Plain numbers subtract and add. Rotations do so on SO(3): the error
of R towards R_d is the rotation vector e = log(R R_d'), in the axes of the angular velocities, and
the velocity error is the plain omega - omega_d. For any potential V(|e|), with E = exp(e),

    d|e|/dt = e' A(e)^-1 (omega - E omega_d) / |e| = e' (omega - omega_d) / |e|

since A' e = E' e = e. So h = V'(|e|) e / |e| is the exact gradient of V with respect to the
velocity error, and the storage balance (33) holds to the letter. At |e| = pi the shortest way
changes sides: V is continuous there and greatest, h is bounded and jumps to its opposite, both of
which pull away from that set, so that a motion crosses it or leaves it and never slides along it.
Angles about one axis are plain numbers that start again after a turn; half a turn does the same.
"""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import InputError
from noninteract_ros.subtasks import so3

ValueMotion = tuple[Array, Array, Array]
"""Value (size,) or gap (dim,), with its velocity (dim,) and acceleration (dim,)."""

UNIT_TOLERANCE = 1e-3
UNIT_ROUNDING = 1e-14


class Layout:
    """The numbers of a value: each element has its plain ones, then perhaps one quaternion.

    Args:
        rotates: For each element, whether a quaternion (x, y, z, w) ends it.
        plain: For each element, how many plain numbers it begins with.
        angles: For each element, whether these are angles [rad] of which those a whole turn apart
            are the same; by default none. Their differences go the shorter way round.

    Attributes:
        size: How many numbers a value has.
        dim: How many its velocity has.
        rotates: Whether there are rotations at all.
        values: Places of the plain numbers in a value.
        rates: Places of their rates in a velocity.
        quaternions: Places of the quaternions in a value, shape (r, 4).
        angular: Places of their angular velocities in a velocity, shape (r, 3).
    """

    def __init__(
        self, plain: Sequence[int], rotates: Sequence[bool], angles: Sequence[bool] | None = None
    ) -> None:
        kinds = zip(plain, rotates, angles or (False,) * len(plain), strict=True)
        self._elements = tuple(kinds)
        values: list[int] = []
        rates: list[int] = []
        quaternions: list[range] = []
        angular: list[range] = []
        angles_too: list[bool] = []
        size = dim = 0
        for count, turns, around in self._elements:
            angles_too += [around] * count
            values += range(size, size + count)
            rates += range(dim, dim + count)
            size, dim = size + count, dim + count
            if turns:
                quaternions.append(range(size, size + 4))
                angular.append(range(dim, dim + 3))
                size, dim = size + 4, dim + 3
        self.size, self.dim, self.rotates = size, dim, bool(quaternions)
        self.values, self.rates = np.array(values, dtype=int), np.array(rates, dtype=int)
        self.quaternions = np.array(quaternions, dtype=int).reshape(-1, 4)
        self.angular = np.array(angular, dtype=int).reshape(-1, 3)
        wound = np.array(angles_too, dtype=bool)
        self._wound, self._wound_rates = self.values[wound], self.rates[wound]

    @classmethod
    def scalars(cls, count: int) -> "Layout":
        """A value of plain numbers only."""
        return cls((count,), (False,))

    @classmethod
    def joined(cls, layouts: Sequence["Layout"]) -> "Layout":
        """Several values, one after the other."""
        elements = [element for layout in layouts for element in layout._elements]
        return cls(
            [plain for plain, _, _ in elements],
            [turns for _, turns, _ in elements],
            [wound for _, _, wound in elements],
        )

    @cached_property
    def identity(self) -> Array:
        """The value with zeros and identities, shape (size,)."""
        value = np.zeros(self.size)
        value[self.quaternions[:, 3]] = 1.0
        return value

    def checked(self, values: Array) -> Array:
        """Values with their quaternions at unit length, shape (..., size).

        Those that are so but for rounding stay to the bit: who receives a value has the sender's.

        Raises:
            InputError: A quaternion is not a unit one.
        """
        if not self.rotates:
            return values
        q = values[..., self.quaternions]
        lengths = np.sqrt((q * q).sum(axis=-1))
        wrong = np.abs(lengths - 1.0) > UNIT_TOLERANCE
        if wrong.any():
            raise InputError(f"a quaternion has length {lengths[wrong][0]:.3g}, should be 1")
        result = values.copy()
        lengths = np.where(np.abs(lengths - 1.0) < UNIT_ROUNDING, 1.0, lengths)
        result[..., self.quaternions] = q / lengths[..., None]
        return result

    def difference(self, x: Array, x_d: Array) -> Array:
        """x - x_d; for rotations log(R R_d'), for angles within [-pi, pi]; shape (..., dim)."""
        if not self.rotates:
            return self._shorter(x - x_d)
        e = np.empty((*np.broadcast_shapes(x.shape, x_d.shape)[:-1], self.dim))
        e[..., self.rates] = x[..., self.values] - x_d[..., self.values]
        q, q_d = x[..., self.quaternions], x_d[..., self.quaternions]
        e[..., self.angular] = so3.log(so3.product(q, so3.inverse(q_d)))
        return self._shorter(e)

    def _shorter(self, e: Array) -> Array:
        """Differences of angles the shorter way round, exactly as they are within half a turn."""
        if self._wound.size:
            way = e[..., self._wound_rates]
            e[..., self._wound_rates] = way - 2.0 * np.pi * np.round(way / (2.0 * np.pi))
        return e

    def sum(self, x: Array, gap: Array) -> Array:
        """The value that `difference` finds `gap` away from x: x + gap; exp(gap) R."""
        if not self.rotates:
            return x + gap
        result = np.empty((*gap.shape[:-1], self.size))
        result[..., self.values] = x[..., self.values] + gap[..., self.rates]
        turned = so3.product(so3.exp(gap[..., self.angular]), x[..., self.quaternions])
        result[..., self.quaternions] = so3.normalized(turned)
        return result

    def relative_motion(self, motion: ValueMotion, base: ValueMotion) -> ValueMotion:
        """How a motion differs from another: the difference and its two exact derivatives."""
        linear = tuple(a - b for a, b in zip(motion[1:], base[1:], strict=True))
        rate, rate_rate = linear
        e = self.difference(motion[0], base[0])
        if self.rotates:
            part = self.angular
            phi = e[part]
            omega, alpha = self._carried(phi, base)
            turn, growth = motion[1][part] - omega, motion[2][part] - alpha
            growth = growth - _times(so3.hat(turn), omega)
            A_inverse = so3.inverse_jacobian(phi)
            phi_rate = _times(A_inverse, turn)
            bend = _times(so3.jacobian_rate(phi, phi_rate), phi_rate)
            rate[part], rate_rate[part] = phi_rate, _times(A_inverse, growth - bend)
        return e, rate, rate_rate

    def compose_motion(self, base: ValueMotion, gap: ValueMotion) -> ValueMotion:
        """The motion that a gap leads away from another: undoes `gap`."""
        linear = tuple(a + b for a, b in zip(base[1:], gap[1:], strict=True))
        velocity, acceleration = linear
        if self.rotates:
            part = self.angular
            phi, phi_rate, phi_rate_rate = (item[part] for item in gap)
            omega, alpha = self._carried(phi, base)
            A = so3.jacobian(phi)
            turn = _times(A, phi_rate)
            growth = _times(A, phi_rate_rate) + _times(so3.jacobian_rate(phi, phi_rate), phi_rate)
            velocity[part] = turn + omega
            acceleration[part] = growth + _times(so3.hat(turn), omega) + alpha
        return self.sum(base[0], gap[0]), velocity, acceleration

    def extrapolate(self, motion: ValueMotion, dt: float) -> ValueMotion:
        """A motion `dt` seconds later, its acceleration held.

        Rotations turn on by exp(omega dt + alpha dt^2 / 2), with the exact derivatives of that.
        """
        x, velocity, acceleration = motion
        if self.rotates and (dt == 0.0 or not (velocity.any() or acceleration.any())):
            return motion
        way = dt * velocity + (0.5 * dt * dt) * acceleration
        if not self.rotates:
            return (
                x + dt * velocity + (0.5 * dt * dt) * acceleration,
                velocity + dt * acceleration,
                acceleration,
            )
        still = np.zeros_like(velocity)
        return self.compose_motion(
            (x, still, still), (way, velocity + dt * acceleration, acceleration)
        )

    def deviation(
        self, motion: ValueMotion, before: ValueMotion, dt: float
    ) -> tuple[Array, Array]:
        """Difference and its rate between a motion and where another one led `dt` s later.

        They are the first two of `gap` from `ahead`, without the work for the third.
        """
        if not self.rotates:
            return self.relative_motion(motion, self.extrapolate(before, dt))[:2]
        x, velocity, acceleration = before
        way = dt * velocity + (0.5 * dt * dt) * acceleration
        led, part = velocity + dt * acceleration, self.angular
        e = self.difference(motion[0], self.sum(x, way))
        rate = motion[1] - led
        omega = _times(so3.jacobian(way[part]), led[part])
        turn = motion[1][part] - _times(so3.matrix(so3.exp(e[part])), omega)
        rate[part] = _times(so3.inverse_jacobian(e[part]), turn)
        return e, rate

    def stack_components(self, plain: Array, turns: Array) -> Array:
        """Velocity or gap, shape (dim,), of its plain numbers and its rotation vectors."""
        result = np.empty(self.dim)
        result[self.rates], result[self.angular] = plain, turns.reshape(-1, 3)
        return result

    def origin(self, x: Array) -> Array:
        """Where coordinates near x are counted from: zeros, and x's own rotations and angles."""
        result = self.identity.copy()
        result[self.quaternions] = x[self.quaternions]
        result[self._wound] = x[self._wound]
        return result

    def _carried(self, phi: Array, base: ValueMotion) -> tuple[Array, Array]:
        """Angular velocity and acceleration of the base, turned by exp(phi)."""
        E = so3.matrix(so3.exp(phi))
        return _times(E, base[1][self.angular]), _times(E, base[2][self.angular])


def _times(matrices: Array, vectors: Array) -> Array:
    return (matrices @ vectors[..., None])[..., 0]
