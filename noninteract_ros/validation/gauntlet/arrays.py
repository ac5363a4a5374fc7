# SPDX-License-Identifier: Apache-2.0
"""Arrays of a case for compiled code, and operations on small matrices.

Loops over preallocated arrays compile in a fraction of the time of array expressions and do not
allocate memory.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import config, njit

from noninteract_ros.arrays import Array

Block = tuple[float, float, float, float]  # a 2 x 2 matrix, row by row

# Vectors of four or six numbers do not benefit, and vectorizing adds half to the compile time.
config.LOOP_VECTORIZE = 0
config.SLP_VECTORIZE = 0


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function at its first call; it releases the GIL and divides as NumPy does."""
    return njit(function, nogil=True, error_model="numpy", _nrt=False)


class TeamArrays(NamedTuple):
    """Robots, subtasks and gains; tools have n coordinates y, and x = A y.

    Attributes:
        n: Number of coordinates.
        first: Coordinates of the first subtask; the second one has the rest.
        mixing: A, shape (n, n).
        S: A^-1, shape (n, n).
        masses: Mass along each coordinate of a team of point masses, shape (n,) [kg].
        arms: One row per planar arm, none for point masses, shape (N, 7): both link lengths [m],
            alpha, beta, delta [kg m^2] and the weights' levers gamma_1, gamma_2 [N m].
        y_ref: Tool coordinates at which all errors are zero, shape (n,) [m].
        stiffness: K, shape (n,) [N/m].
        damping: D, shape (n,) [N s/m].
    """

    n: int
    first: int
    mixing: Array
    S: Array
    masses: Array
    arms: Array
    y_ref: Array
    stiffness: Array
    damping: Array


class SurroundingsArrays(NamedTuple):
    """Passive environment at the tool coordinates and its own bodies, z = (y, bodies).

    Attributes:
        inertia: Masses carried and bodies, shape (m, m) [kg].
        stiffness: Springs, shape (m, m) [N/m].
        damping: Dampers, shape (m, m) [N s/m].
        rest: Force of the springs at z = 0, shape (m,) [N].
        preload: Their energy at z = 0 [J].
        directions: Unit vectors of one-sided contacts, shape (c, m).
        contact_stiffness: Their springs, shape (c,) [N/m].
        gaps: Distance along each direction to contact, shape (c,) [m].
    """

    inertia: Array
    stiffness: Array
    damping: Array
    rest: Array
    preload: float
    directions: Array
    contact_stiffness: Array
    gaps: Array


@compiled
def multiply(A: Array, x: Array, result: Array) -> None:
    """result = A x; x may be longer than A is wide."""
    for i in range(A.shape[0]):
        total = 0.0
        for j in range(A.shape[1]):
            total += A[i, j] * x[j]
        result[i] = total


@compiled
def multiply_transposed(A: Array, x: Array, result: Array) -> None:
    """result = A' x."""
    for j in range(A.shape[1]):
        result[j] = 0.0
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            result[j] += A[i, j] * x[i]


@compiled
def dot(x: Array, y: Array, count: int) -> float:
    """x' y over the first numbers."""
    total = 0.0
    for i in range(count):
        total += x[i] * y[i]
    return total


@compiled
def row_dot(A: Array, i: int, x: Array) -> float:
    """Row i of A times x."""
    total = 0.0
    for j in range(A.shape[1]):
        total += A[i, j] * x[j]
    return total


@compiled
def quadratic(A: Array, x: Array) -> float:
    """x' A x; x may be longer than A."""
    total = 0.0
    for i in range(A.shape[0]):
        inner = 0.0
        for j in range(A.shape[1]):
            inner += A[i, j] * x[j]
        total += x[i] * inner
    return total


@compiled
def add_scaled(x: Array, a: float, y: Array, result: Array) -> None:
    """result = x + a y."""
    for i in range(len(result)):
        result[i] = x[i] + a * y[i]


@compiled
def copy(x: Array, result: Array) -> None:
    """result = x, as far as it is long."""
    for i in range(len(result)):
        result[i] = x[i]


@compiled
def congruent(A: Array, B: Array, result: Array) -> None:
    """result = A' B A of square matrices."""
    n = len(A)
    for i in range(n):
        for j in range(n):
            result[i, j] = 0.0
    for k in range(n):
        for j in range(n):
            inner = 0.0
            for m in range(n):
                inner += B[k, m] * A[m, j]
            for i in range(n):
                result[i, j] += A[k, i] * inner


@compiled
def times(A: Block, B: Block) -> Block:
    """A B."""
    return (
        A[0] * B[0] + A[1] * B[2],
        A[0] * B[1] + A[1] * B[3],
        A[2] * B[0] + A[3] * B[2],
        A[2] * B[1] + A[3] * B[3],
    )


@compiled
def transposed(A: Block) -> Block:
    """A'."""
    return (A[0], A[2], A[1], A[3])


@compiled
def inverted(A: Block) -> Block:
    """A^-1."""
    determinant = A[0] * A[3] - A[1] * A[2]
    return (
        A[3] / determinant,
        -A[1] / determinant,
        -A[2] / determinant,
        A[0] / determinant,
    )


@compiled
def put(A: Array, at: int, block: Block) -> None:
    """Write a diagonal block."""
    A[at, at], A[at, at + 1], A[at + 1, at], A[at + 1, at + 1] = block


@compiled
def solve_in_place(A: Array, b: Array) -> None:
    """Replace b by A^-1 b and A by its Cholesky factor; A is symmetric positive definite."""
    m = len(b)
    for i in range(m):
        for j in range(i + 1):
            total = A[i, j]
            for k in range(j):
                total -= A[i, k] * A[j, k]
            A[i, j] = np.sqrt(total) if i == j else total / A[j, j]
        for k in range(i):
            b[i] -= A[i, k] * b[k]
        b[i] /= A[i, i]
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            b[i] -= A[k, i] * b[k]
        b[i] /= A[i, i]
