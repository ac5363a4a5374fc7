# SPDX-License-Identifier: Apache-2.0
"""Vectors of three numbers as tuples, which need no memory allocation."""

from noninteract_ros.arrays import Array
from noninteract_ros.compiler import inner

Vector = tuple[float, float, float]


@inner
def at(A: Array, i: int) -> Vector:
    """Return a row of an array as a tuple."""
    return A[i, 0], A[i, 1], A[i, 2]


@inner
def put(A: Array, i: int, x: Vector) -> None:
    """Write a tuple into a row of an array."""
    A[i, 0], A[i, 1], A[i, 2] = x


@inner
def added(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inner
def difference(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inner
def along(a: Vector, s: float, d: Vector) -> Vector:
    """Return a + s d."""
    return a[0] + s * d[0], a[1] + s * d[1], a[2] + s * d[2]


@inner
def cross(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inner
def dot(a: Vector, b: Vector) -> float:
    """Return a'b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner
def turned(R: Array, i: int, x: Vector) -> Vector:
    """Return R_i x of a stack of rotations."""
    return (
        R[i, 0, 0] * x[0] + R[i, 0, 1] * x[1] + R[i, 0, 2] * x[2],
        R[i, 1, 0] * x[0] + R[i, 1, 1] * x[1] + R[i, 1, 2] * x[2],
        R[i, 2, 0] * x[0] + R[i, 2, 1] * x[1] + R[i, 2, 2] * x[2],
    )
