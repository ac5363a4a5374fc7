# SPDX-License-Identifier: Apache-2.0
"""Algebra of small matrices in stacks of shape (count, rows, columns), selected by index.

The left factor sets the size: of a taller factor or result, only the first rows are used.
"""

import math

from noninteract_ros.arrays import Array
from noninteract_ros.compiler import inner


@inner
def add_product(scale: float, A: Array, a: int, B: Array, b: int, out: Array, o: int) -> None:
    """out += scale A B."""
    for i in range(A.shape[1]):
        for k in range(A.shape[2]):
            factor = scale * A[a, i, k]
            for j in range(B.shape[2]):
                out[o, i, j] += factor * B[b, k, j]


@inner
def add_transposed_product(
    scale: float, A: Array, a: int, B: Array, b: int, out: Array, o: int
) -> None:
    """out += scale A' B."""
    for k in range(A.shape[1]):
        for i in range(A.shape[2]):
            factor = scale * A[a, k, i]
            for j in range(B.shape[2]):
                out[o, i, j] += factor * B[b, k, j]


@inner
def product(A: Array, a: int, B: Array, b: int, out: Array, o: int) -> None:
    """out = A B."""
    clear(out, o, A.shape[1])
    add_product(1.0, A, a, B, b, out, o)


@inner
def transposed_product(A: Array, a: int, B: Array, b: int, out: Array, o: int) -> None:
    """out = A' B."""
    clear(out, o, A.shape[2])
    add_transposed_product(1.0, A, a, B, b, out, o)


@inner
def clear(out: Array, o: int, rows: int) -> None:
    """Set the first rows to zero."""
    for i in range(rows):
        for j in range(out.shape[2]):
            out[o, i, j] = 0.0


@inner
def add(scale: float, A: Array, a: int, out: Array, o: int, rows: int) -> None:
    """Add to the first rows: out += scale A."""
    for i in range(rows):
        for j in range(out.shape[2]):
            out[o, i, j] += scale * A[a, i, j]


@inner
def cut(A: Array, a: int, first: int, out: Array, o: int) -> None:
    """Copy a diagonal block: out = A[first:, first:]."""
    for i in range(out.shape[1]):
        for j in range(out.shape[2]):
            out[o, i, j] = A[a, first + i, first + j]


@inner
def invert(A: Array, a: int, work: Array, out: Array, o: int) -> None:
    """out = A^-1 by elimination with pivots; `work`, a stack of one, is overwritten.

    For an exactly singular A, the inverse of a nearby regular matrix, with very large entries.
    """
    size, shift = 0.0, 0.0
    for i in range(A.shape[1]):
        for j in range(A.shape[2]):
            size = max(size, abs(A[a, i, j]))
    size = size if size > 0.0 else 1.0
    while not _eliminate(A, a, shift, work, out, o):
        shift = 10.0 * shift + 1e-9 * size


@inner
def _eliminate(A: Array, a: int, shift: float, work: Array, out: Array, o: int) -> bool:
    """Invert A + shift 1; return False if it is singular."""
    n = A.shape[1]
    for i in range(n):
        for j in range(n):
            work[0, i, j] = A[a, i, j] + (shift if i == j else 0.0)
            out[o, i, j] = 1.0 if i == j else 0.0
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(work[0, i, k]) > abs(work[0, best, k]):
                best = i
        if work[0, best, k] == 0.0:
            return False
        scale = 1.0 / work[0, best, k]
        for j in range(n):
            pivot, result = work[0, best, j], out[o, best, j]
            work[0, best, j], out[o, best, j] = work[0, k, j], out[o, k, j]
            work[0, k, j], out[o, k, j] = scale * pivot, scale * result
        for i in range(n):
            factor = work[0, i, k]
            if i != k and factor != 0.0:
                for j in range(n):
                    work[0, i, j] -= factor * work[0, k, j]
                    out[o, i, j] -= factor * out[o, k, j]
    return True


@inner
def factorize(A: Array, a: int) -> None:
    """Replace the lower triangle of a positive-definite A by its Cholesky factor."""
    n = A.shape[1]
    for j in range(n):
        for k in range(j):
            factor = A[a, j, k]
            for i in range(j, n):
                A[a, i, j] -= factor * A[a, i, k]
        scale = 1.0 / math.sqrt(A[a, j, j])
        for i in range(j, n):
            A[a, i, j] *= scale


@inner
def solve(F: Array, f: int, X: Array, x: int) -> None:
    """Replace the columns of X by A^-1 X; F is A after `factorize`."""
    n = F.shape[1]
    for i in range(n):
        scale = 1.0 / F[f, i, i]
        for j in range(X.shape[2]):
            for k in range(i):
                X[x, i, j] -= F[f, i, k] * X[x, k, j]
            X[x, i, j] *= scale
    for i in range(n - 1, -1, -1):
        scale = 1.0 / F[f, i, i]
        for j in range(X.shape[2]):
            for k in range(i + 1, n):
                X[x, i, j] -= F[f, k, i] * X[x, k, j]
            X[x, i, j] *= scale
