# SPDX-License-Identifier: Apache-2.0
"""Rotations on SO(3): quaternions (x, y, z, w), rotation vectors and their differentials.

All functions accept any leading dimensions, and are exact near zero, where series replace the
closed forms. The angular velocity omega of a matrix R satisfies dR/dt = [omega] R, in the axes
that R maps to. For R = exp(phi)

    omega = A(phi) dphi/dt,    A = 1 + a [phi] + b [phi]^2,    A^-1 = 1 - [phi] / 2 + c [phi]^2

with a = (1 - cos t) / t^2, b = (t - sin t) / t^3, c = (1 - (t / 2) cot(t / 2)) / t^2, t = |phi|.
Since A phi = A' phi = phi, the gradient of half the squared angle is the rotation vector.
"""

import math
from collections.abc import Callable

import numpy as np
import pinocchio as pin
from scipy.special import bernoulli

from noninteract_ros.arrays import Array

# The remainder after twelve terms is below rounding for t < 1.
_TERMS = range(12)
_POWERS = np.arange(float(len(_TERMS)))


class Coefficient:
    """Even function f of the angle t, exact at any angle below 2 pi.

    Args:
        series: Coefficients of the power series in t^2.
        value: f(t) for t >= 1.
        slope: (df/dt) / t for t >= 1.
    """

    def __init__(
        self,
        series: list[float],
        value: Callable[[Array], Array],
        slope: Callable[[Array], Array],
    ) -> None:
        self._value, self._slope = value, slope
        self.series = np.array(series)
        self.slope_series = 2.0 * _POWERS[1:] * self.series[1:]

    def value(self, phi: Array) -> Array:
        """Return f(|phi|), shape (..., 1, 1)."""
        return self._at(phi, self.series, self._value)

    def slope(self, phi: Array, phi_rate: Array) -> Array:
        """Return df/dt along a motion of phi, shape (..., 1, 1)."""
        along = (phi * phi_rate).sum(axis=-1)[..., None, None]
        return along * self._at(phi, self.slope_series, self._slope)

    @staticmethod
    def _at(phi: Array, series: Array, closed: Callable[[Array], Array]) -> Array:
        square = (phi * phi).sum(axis=-1)[..., None, None]
        powers = np.minimum(square, 1.0)[..., None] ** _POWERS[: len(series)]
        near = powers @ series
        if not (square >= 1.0).any():
            return near
        return np.where(square < 1.0, near, closed(np.sqrt(np.maximum(square, 1.0))))


_BERNOULLI = bernoulli(2 * len(_TERMS))
ANGLE_A = Coefficient(
    [(-1) ** k / math.factorial(2 * k + 2) for k in _TERMS],
    lambda t: (1.0 - np.cos(t)) / t**2,
    lambda t: (t * np.sin(t) + 2.0 * np.cos(t) - 2.0) / t**4,
)
ANGLE_B = Coefficient(
    [(-1) ** k / math.factorial(2 * k + 3) for k in _TERMS],
    lambda t: (t - np.sin(t)) / t**3,
    lambda t: (3.0 * np.sin(t) - t * np.cos(t) - 2.0 * t) / t**5,
)
ANGLE_C = Coefficient(
    [abs(_BERNOULLI[2 * k + 2]) / math.factorial(2 * k + 2) for k in _TERMS],
    lambda t: (1.0 - 0.5 * t / np.tan(0.5 * t)) / t**2,
    lambda t: (0.5 * t / np.tan(0.5 * t) + 0.25 * (t / np.sin(0.5 * t)) ** 2 - 2.0) / t**4,
)

_GENERATORS: Array = np.zeros((3, 3, 3))  # hat(w)[j, k] = sum over i of w[i] G[i, j, k]
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    _GENERATORS[_i, _k, _j], _GENERATORS[_i, _j, _k] = 1.0, -1.0
_GENERATORS = _GENERATORS.reshape(3, 9)
_LEFT: Array = np.zeros((4, 4, 4))  # p q [j] = sum over i and k of p[i] L[i, j, k] q[k]
_LEFT[:3, :3, :3] = _GENERATORS.reshape(3, 3, 3)
_LEFT[3] = np.eye(4)
for _i in range(3):
    _LEFT[_i, _i, 3], _LEFT[_i, 3, _i] = 1.0, -1.0
_LEFT = _LEFT.reshape(4, 16)
_IDENTITY = np.eye(3)


def hat(w: Array) -> Array:
    """Return the matrix [w] with [w] u = w x u, shape (..., 3, 3)."""
    return (w @ _GENERATORS).reshape(*w.shape, 3)


def exp(phi: Array) -> Array:
    """Return the unit quaternion of a rotation vector [rad], shape (..., 4)."""
    angle = np.sqrt((phi * phi).sum(axis=-1, keepdims=True))
    return np.concatenate([0.5 * np.sinc(angle / (2.0 * np.pi)) * phi, np.cos(0.5 * angle)], -1)


def log(q: Array) -> Array:
    """Return the shortest rotation vector of a quaternion of either sign [rad], shape (..., 3).

    Its length is at most pi, where it jumps to the opposite vector.
    """
    vector, scalar = q[..., :3], q[..., 3:]
    size = np.sqrt((vector * vector).sum(axis=-1, keepdims=True))
    angle = 2.0 * np.arctan2(size, np.abs(scalar))
    positive = size > 0.0
    scale = np.where(positive, angle, 2.0) / np.where(positive, size, 1.0)
    return np.where(scalar < 0.0, -scale, scale) * vector


def product(p: Array, q: Array) -> Array:
    """Return the quaternion of the rotation q followed by p, shape (..., 4)."""
    from_left = (p @ _LEFT).reshape(*p.shape, 4)
    return (from_left @ q[..., None])[..., 0]


def inverse(q: Array) -> Array:
    """Return the inverse of a unit quaternion, shape (..., 4)."""
    return q * np.array([-1.0, -1.0, -1.0, 1.0])


def normalized(q: Array) -> Array:
    """Return the quaternion at unit length, shape (..., 4)."""
    return q / np.sqrt((q * q).sum(axis=-1, keepdims=True))


def matrix(q: Array) -> Array:
    """Return the rotation matrix of a unit quaternion, shape (..., 3, 3)."""
    cross = hat(q[..., :3])
    return _IDENTITY + 2.0 * (q[..., 3, None, None] * cross + cross @ cross)


def quaternion(R: Array) -> Array:
    """Return the unit quaternion of a rotation matrix with w >= 0, shape (..., 4)."""
    rows = [pin.Quaternion(matrix).coeffs() for matrix in R.reshape(-1, 3, 3)]
    q = normalized(np.array(rows)).reshape(*R.shape[:-2], 4)
    return np.where(q[..., 3:] < 0.0, -q, q)


def jacobian(phi: Array) -> Array:
    """Return A(phi), shape (..., 3, 3): angular velocity of exp(phi) per rate of phi."""
    cross = hat(phi)
    return _IDENTITY + ANGLE_A.value(phi) * cross + ANGLE_B.value(phi) * (cross @ cross)


def jacobian_rate(phi: Array, phi_rate: Array) -> Array:
    """Return dA/dt along a motion of phi, shape (..., 3, 3)."""
    cross, cross_rate = hat(phi), hat(phi_rate)
    linear = ANGLE_A.slope(phi, phi_rate) * cross + ANGLE_A.value(phi) * cross_rate
    return linear + _squared_rate(ANGLE_B, phi, phi_rate, cross, cross_rate)


def inverse_jacobian(phi: Array) -> Array:
    """Return A(phi)^-1, shape (..., 3, 3), bounded up to |phi| = pi and singular at 2 pi."""
    cross = hat(phi)
    return _IDENTITY - 0.5 * cross + ANGLE_C.value(phi) * (cross @ cross)


def inverse_jacobian_rate(phi: Array, phi_rate: Array) -> Array:
    """Return d(A^-1)/dt along a motion of phi, shape (..., 3, 3)."""
    cross, cross_rate = hat(phi), hat(phi_rate)
    return _squared_rate(ANGLE_C, phi, phi_rate, cross, cross_rate) - 0.5 * cross_rate


def _squared_rate(
    factor: Coefficient, phi: Array, phi_rate: Array, cross: Array, cross_rate: Array
) -> Array:
    """Return the time derivative of f [phi]^2."""
    mixed = cross_rate @ cross
    square_rate = mixed + np.swapaxes(mixed, -1, -2)
    return factor.slope(phi, phi_rate) * (cross @ cross) + factor.value(phi) * square_rate
