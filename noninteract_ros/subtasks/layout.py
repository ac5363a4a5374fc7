# SPDX-License-Identifier: Apache-2.0
"""Arithmetic of subtask values that consist of scalars and quaternions.

A value has `size` numbers and its velocity `dim`: a rotation is a quaternion of four numbers in
the value and an angular velocity of three in the velocity. Scalars are subtracted and added.
Rotations are treated on SO(3): the error of R with respect to R_d is the rotation vector
e = log(R R_d'), in the axes of the angular velocities, and the velocity error is the difference
omega - omega_d. For any potential V(|e|), with E = exp(e),

    d|e|/dt = e' A(e)^-1 (omega - E omega_d) / |e| = e' (omega - omega_d) / |e|

since A' e = E' e = e. Hence h = V'(|e|) e / |e| is the exact gradient of V with respect to the
velocity error, and the storage balance (33) holds exactly. At |e| = pi the shortest rotation
changes direction: V is continuous and largest there, and h is bounded and changes sign. Both
values of h drive the motion away from that set: it crosses or leaves it, and never slides along
it. Angles about one axis are scalars that repeat after a full turn; half a turn is alike.
"""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import InputError
from noninteract_ros.subtasks import so3

ValueMotion = tuple[Array, Array, Array]
"""Value (size,) or difference (dim,), with its velocity (dim,) and acceleration (dim,)."""

UNIT_TOLERANCE = 1e-3
UNIT_ROUNDING = 1e-14


class Layout:
    """Layout of a value: each element has scalars, optionally followed by one quaternion.

    Args:
        scalars: Number of scalars of each element.
        rotates: For each element, True if it ends with a quaternion (x, y, z, w).
        angles: For each element, True if its scalars are angles [rad], equal up to full turns; by
            default none. Their differences are the shortest ones.

    Attributes:
        size: Dimension of a value.
        dim: Dimension of a velocity.
        rotates: True if any element has a rotation.
        values: Indices of the scalars in a value.
        rates: Indices of the scalars' rates in a velocity.
        quaternions: Indices of the quaternions in a value, shape (r, 4).
        angular: Indices of the angular velocities in a velocity, shape (r, 3).
    """

    def __init__(
        self, scalars: Sequence[int], rotates: Sequence[bool], angles: Sequence[bool] | None = None
    ) -> None:
        kinds = zip(scalars, rotates, angles or (False,) * len(scalars), strict=True)
        self._elements = tuple(kinds)
        values: list[int] = []
        rates: list[int] = []
        quaternions: list[range] = []
        angular: list[range] = []
        are_angles: list[bool] = []
        size = dim = 0
        for count, has_rotation, has_angles in self._elements:
            are_angles += [has_angles] * count
            values += range(size, size + count)
            rates += range(dim, dim + count)
            size, dim = size + count, dim + count
            if has_rotation:
                quaternions.append(range(size, size + 4))
                angular.append(range(dim, dim + 3))
                size, dim = size + 4, dim + 3
        self.size, self.dim, self.rotates = size, dim, bool(quaternions)
        self.values, self.rates = np.array(values, dtype=int), np.array(rates, dtype=int)
        self.quaternions = np.array(quaternions, dtype=int).reshape(-1, 4)
        self.angular = np.array(angular, dtype=int).reshape(-1, 3)
        mask = np.array(are_angles, dtype=bool)
        self._angles, self._angle_rates = self.values[mask], self.rates[mask]

    @classmethod
    def scalars(cls, count: int) -> "Layout":
        """Return the layout of a value with scalars only."""
        return cls((count,), (False,))

    @classmethod
    def joined(cls, layouts: Sequence["Layout"]) -> "Layout":
        """Return the layout of several values, one after the other."""
        elements = [element for layout in layouts for element in layout._elements]
        return cls(
            [count for count, _, _ in elements],
            [has_rotation for _, has_rotation, _ in elements],
            [has_angles for _, _, has_angles in elements],
        )

    @cached_property
    def identity(self) -> Array:
        """Value of zeros and identity rotations, shape (size,)."""
        value = np.zeros(self.size)
        value[self.quaternions[:, 3]] = 1.0
        return value

    def checked(self, values: Array) -> Array:
        """Return values with their quaternions normalised, shape (..., size).

        Quaternions of unit length up to rounding are returned to the bit, so that the receiver of
        a value has the value of the sender.

        Raises:
            InputError: A quaternion is not of unit length.
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
        """Return x - x_d: log(R R_d') for rotations, wrapped for angles; shape (..., dim)."""
        if not self.rotates:
            return self._shortest(x - x_d)
        e = np.empty((*np.broadcast_shapes(x.shape, x_d.shape)[:-1], self.dim))
        e[..., self.rates] = x[..., self.values] - x_d[..., self.values]
        q, q_d = x[..., self.quaternions], x_d[..., self.quaternions]
        e[..., self.angular] = so3.log(so3.product(q, so3.inverse(q_d)))
        return self._shortest(e)

    def _shortest(self, e: Array) -> Array:
        """Wrap differences of angles to [-pi, pi]; differences within half a turn stay exact."""
        if self._angles.size:
            turn = e[..., self._angle_rates]
            e[..., self._angle_rates] = turn - 2.0 * np.pi * np.round(turn / (2.0 * np.pi))
        return e

    def sum(self, x: Array, gap: Array) -> Array:
        """Return the value x + gap, exp(gap) R for rotations: the inverse of `difference`."""
        if not self.rotates:
            return x + gap
        result = np.empty((*gap.shape[:-1], self.size))
        result[..., self.values] = x[..., self.values] + gap[..., self.rates]
        turned = so3.product(so3.exp(gap[..., self.angular]), x[..., self.quaternions])
        result[..., self.quaternions] = so3.normalized(turned)
        return result

    def relative_motion(self, motion: ValueMotion, base: ValueMotion) -> ValueMotion:
        """Return the difference of two motions and its two exact time derivatives."""
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
        """Return the motion with a given difference from another; inverse of `relative_motion`."""
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
        """Return a motion `dt` seconds later, under constant acceleration.

        Rotations advance by exp(omega dt + alpha dt^2 / 2), with its exact derivatives.
        """
        x, velocity, acceleration = motion
        if self.rotates and (dt == 0.0 or not (velocity.any() or acceleration.any())):
            return motion
        step = dt * velocity + (0.5 * dt * dt) * acceleration
        if not self.rotates:
            return (
                x + dt * velocity + (0.5 * dt * dt) * acceleration,
                velocity + dt * acceleration,
                acceleration,
            )
        zero = np.zeros_like(velocity)
        return self.compose_motion(
            (x, zero, zero), (step, velocity + dt * acceleration, acceleration)
        )

    def deviation(
        self, motion: ValueMotion, before: ValueMotion, dt: float
    ) -> tuple[Array, Array]:
        """Return the difference, and its rate, of a motion from an extrapolated earlier one.

        Both equal the first two results of `relative_motion` with respect to the motion `before`,
        extrapolated by `dt` [s], at less cost.
        """
        if not self.rotates:
            return self.relative_motion(motion, self.extrapolate(before, dt))[:2]
        x, velocity, acceleration = before
        step = dt * velocity + (0.5 * dt * dt) * acceleration
        later, part = velocity + dt * acceleration, self.angular
        e = self.difference(motion[0], self.sum(x, step))
        rate = motion[1] - later
        omega = _times(so3.jacobian(step[part]), later[part])
        turn = motion[1][part] - _times(so3.matrix(so3.exp(e[part])), omega)
        rate[part] = _times(so3.inverse_jacobian(e[part]), turn)
        return e, rate

    def stack_components(self, scalars: Array, rotation_vectors: Array) -> Array:
        """Return a velocity or difference, shape (dim,), of its scalars and rotation vectors."""
        result = np.empty(self.dim)
        result[self.rates], result[self.angular] = scalars, rotation_vectors.reshape(-1, 3)
        return result

    def origin(self, x: Array) -> Array:
        """Return the origin of local coordinates near x: zeros, and rotations and angles of x."""
        result = self.identity.copy()
        result[self.quaternions] = x[self.quaternions]
        result[self._angles] = x[self._angles]
        return result

    def _carried(self, phi: Array, base: ValueMotion) -> tuple[Array, Array]:
        """Return angular velocity and acceleration of the base, rotated by exp(phi)."""
        E = so3.matrix(so3.exp(phi))
        return _times(E, base[1][self.angular]), _times(E, base[2][self.angular])


def _times(matrices: Array, vectors: Array) -> Array:
    return (matrices @ vectors[..., None])[..., 0]
