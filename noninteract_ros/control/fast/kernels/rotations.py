# SPDX-License-Identifier: Apache-2.0
"""Single rotations in closed form; see `subtasks.so3` for any number of them.

Quaternions (x, y, z, w) and vectors are tuples, matrices are arrays.
"""

import math
from typing import cast

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.compiler import inner
from noninteract_ros.subtasks import so3

Quaternion = tuple[float, float, float, float]
Vector = tuple[float, float, float]

_A, _B = so3.ANGLE_A.series, so3.ANGLE_B.series
ANGULAR = cast(int, np.intp(3))  # First index of the angular part of a twist.
_C, _C_SLOPE = so3.ANGLE_C.series, so3.ANGLE_C.slope_series


@inner
def product(p: Quaternion, q: Quaternion) -> Quaternion:
    """Return the quaternion of the rotation q followed by p."""
    x, y, z, w = p
    a, b, c, d = q
    return (
        w * a + x * d + y * c - z * b,
        w * b + y * d + z * a - x * c,
        w * c + z * d + x * b - y * a,
        w * d - x * a - y * b - z * c,
    )


@inner
def inverse(q: Quaternion) -> Quaternion:
    """Return the inverse of a unit quaternion."""
    return -q[0], -q[1], -q[2], q[3]


@inner
def normalized(q: Quaternion) -> Quaternion:
    """Return the quaternion at unit length."""
    scale = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return scale * q[0], scale * q[1], scale * q[2], scale * q[3]


@inner
def positive(q: Quaternion) -> Quaternion:
    """Return the same rotation with w >= 0."""
    return q if q[3] >= 0.0 else (-q[0], -q[1], -q[2], -q[3])


@inner
def exp(phi: Vector) -> Quaternion:
    """Return the unit quaternion of a rotation vector [rad]."""
    angle = math.sqrt(phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2])
    half = 0.5 * angle
    scale = 0.5 if half == 0.0 else 0.5 * math.sin(half) / half
    return scale * phi[0], scale * phi[1], scale * phi[2], math.cos(half)


@inner
def log(q: Quaternion) -> Vector:
    """Return the shortest rotation vector of a quaternion of either sign [rad]."""
    size = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2])
    scale = 2.0 if size == 0.0 else 2.0 * math.atan2(size, abs(q[3])) / size
    if q[3] < 0.0:
        scale = -scale
    return scale * q[0], scale * q[1], scale * q[2]


@inner
def put_matrix(q: Quaternion, R: Array, r: int) -> None:
    """Write the rotation matrix of a unit quaternion."""
    x, y, z, w = q
    for i in range(3):
        R[r, i, i] = 1.0
    R[r, 0, 0] -= 2.0 * (y * y + z * z)
    R[r, 1, 1] -= 2.0 * (x * x + z * z)
    R[r, 2, 2] -= 2.0 * (x * x + y * y)
    R[r, 0, 1], R[r, 1, 0] = 2.0 * (x * y - w * z), 2.0 * (x * y + w * z)
    R[r, 0, 2], R[r, 2, 0] = 2.0 * (x * z + w * y), 2.0 * (x * z - w * y)
    R[r, 1, 2], R[r, 2, 1] = 2.0 * (y * z - w * x), 2.0 * (y * z + w * x)


@inner
def of_matrix(R: Array, r: int) -> Quaternion:
    """Return the unit quaternion of a rotation matrix, w >= 0, from its largest component."""
    a, b, c = R[r, 0, 0], R[r, 1, 1], R[r, 2, 2]
    x, y, z = R[r, 2, 1] - R[r, 1, 2], R[r, 0, 2] - R[r, 2, 0], R[r, 1, 0] - R[r, 0, 1]
    xy, xz, yz = R[r, 1, 0] + R[r, 0, 1], R[r, 0, 2] + R[r, 2, 0], R[r, 2, 1] + R[r, 1, 2]
    if a + b + c > 0.0:
        q = x, y, z, 1.0 + a + b + c
    elif a >= b and a >= c:
        q = 1.0 + a - b - c, xy, xz, x
    elif b >= c:
        q = xy, 1.0 + b - a - c, yz, y
    else:
        q = xz, yz, 1.0 + c - a - b, z
    return positive(normalized(q))


@inner
def _series(series: Array, square: float) -> float:
    total = 0.0
    for k in range(len(series) - 1, -1, -1):
        total = total * square + series[k]
    return total


@inner
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner
def _put(phi: Vector, linear: float, squared: float, out: Array, o: int) -> None:
    """Write 1 + linear [phi] + squared [phi]^2, with [phi]^2 = phi phi' - |phi|^2."""
    x, y, z = phi
    own = 1.0 - squared * _dot(phi, phi)
    out[o, 0, 0], out[o, 1, 1] = own + squared * x * x, own + squared * y * y
    out[o, 2, 2] = own + squared * z * z
    out[o, 0, 1], out[o, 1, 0] = squared * x * y - linear * z, squared * x * y + linear * z
    out[o, 0, 2], out[o, 2, 0] = squared * x * z + linear * y, squared * x * z - linear * y
    out[o, 1, 2], out[o, 2, 1] = squared * y * z - linear * x, squared * y * z + linear * x


@inner
def put_jacobian(phi: Vector, out: Array, o: int) -> None:
    """Write A(phi): angular velocity of exp(phi) per rate of phi."""
    square = _dot(phi, phi)
    if square < 1.0:
        a, b = _series(_A, square), _series(_B, square)
    else:
        t = math.sqrt(square)
        a, b = (1.0 - math.cos(t)) / square, (t - math.sin(t)) / (square * t)
    _put(phi, a, b, out, o)


@inner
def put_inverse_jacobian(phi: Vector, out: Array, o: int) -> None:
    """Write A(phi)^-1."""
    square = _dot(phi, phi)
    if square < 1.0:
        c = _series(_C, square)
    else:
        half = 0.5 * math.sqrt(square)
        c = (1.0 - half / math.tan(half)) / square
    _put(phi, -0.5, c, out, o)


@inner
def put_inverse_jacobian_rate(phi: Vector, phi_rate: Vector, out: Array, o: int) -> None:
    """Write d(A^-1)/dt along a motion of phi."""
    square, along = _dot(phi, phi), _dot(phi, phi_rate)
    if square < 1.0:
        c, slope = _series(_C, square), along * _series(_C_SLOPE, square)
    else:
        half = 0.5 * math.sqrt(square)
        cotangent, sine = half / math.tan(half), half / math.sin(half)
        c = (1.0 - cotangent) / square
        slope = along * (cotangent + sine * sine - 2.0) / (square * square)
    _put(phi_rate, -0.5, 0.0, out, o)
    for i in range(3):
        for j in range(3):
            moved = phi_rate[i] * phi[j] + phi[i] * phi_rate[j]
            out[o, i, j] += slope * phi[i] * phi[j] + c * moved
        out[o, i, i] -= 1.0 + slope * square + 2.0 * c * along


@inner
def times(A: Array, a: int, u: Vector) -> Vector:
    """Return A u."""
    return (
        A[a, 0, 0] * u[0] + A[a, 0, 1] * u[1] + A[a, 0, 2] * u[2],
        A[a, 1, 0] * u[0] + A[a, 1, 1] * u[1] + A[a, 1, 2] * u[2],
        A[a, 2, 0] * u[0] + A[a, 2, 1] * u[1] + A[a, 2, 2] * u[2],
    )


@inner
def transposed_times(A: Array, a: int, u: Vector) -> Vector:
    """Return A' u."""
    return (
        A[a, 0, 0] * u[0] + A[a, 1, 0] * u[1] + A[a, 2, 0] * u[2],
        A[a, 0, 1] * u[0] + A[a, 1, 1] * u[1] + A[a, 2, 1] * u[2],
        A[a, 0, 2] * u[0] + A[a, 1, 2] * u[1] + A[a, 2, 2] * u[2],
    )


@inner
def cross(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inner
def combined(scale: float, a: Vector, b: Vector) -> Vector:
    """Return scale a + b."""
    return scale * a[0] + b[0], scale * a[1] + b[1], scale * a[2] + b[2]


@inner
def vector_at(A: Array, row: int, first: int) -> Vector:
    """Return three numbers of a row."""
    return A[row, first], A[row, first + 1], A[row, first + 2]


@inner
def row_at(A: Array, a: int, row: int) -> Vector:
    """Return a row of a matrix."""
    return A[a, row, 0], A[a, row, 1], A[a, row, 2]


@inner
def quaternion_at(A: Array, row: int, first: int) -> Quaternion:
    """Return four numbers of a row."""
    return A[row, first], A[row, first + 1], A[row, first + 2], A[row, first + 3]


@inner
def put_quaternion(q: Quaternion, A: Array, row: int, first: int) -> None:
    """Write a quaternion into a row."""
    for i in range(4):
        A[row, first + i] = q[i]
