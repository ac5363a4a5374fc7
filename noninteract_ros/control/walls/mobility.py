# SPDX-License-Identifier: Apache-2.0
"""Mobility of subtasks by the order in which they give way."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array

Indices = NDArray[np.intp]
SOFT = 1e-3  # eigenvalue below which a direction counts as lost by and by, in units of the start
FIRM = 1e8  # how much firmer the first order is than the last
STEP = 10.0  # how much firmer each order is than the one after it


def soft_inverse(A: Array, lowest: float = SOFT) -> Array:
    """Return f(A), f = 1/x on eigenvalues x from `lowest` on, (3 - 3y + y^2)/lowest below.

    With y = x/lowest, f is twice differentiable and never above 3/lowest.
    """
    values, vectors = np.linalg.eigh(0.5 * (A + A.T))
    y = np.clip(values / lowest, 0.0, None)
    f = np.where(y >= 1.0, 1.0 / np.maximum(values, lowest), (3.0 - 3.0 * y + y * y) / lowest)
    return (vectors * f) @ vectors.T


def row_scales(J: Array, M_inverse: Array) -> Array:
    """Return the roots of diag(J M^-1 J'), which scale rows of unlike units, shape (p,)."""
    return np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", J, M_inverse, J), 1e-12))


def giving_way(J: Array, M_inverse: Array, orders: Sequence[Indices], scales: Array) -> Array:
    """Return W = sum of Q_l / w_l and Q_N, shape (n, n): how easily motions give way.

    Q_l is the mobility that order l has in what earlier orders leave, Q_N that of the rest; they
    add up to M^-1. W is positive definite whatever the rank of J.

    Args:
        J: Jacobian of all subtasks, shape (p, n).
        M_inverse: Inverse of the team's inertia, shape (n, n).
        orders: Coordinates of each order, the firmest first.
        scales: `row_scales` at the start, shape (p,).
    """
    left = M_inverse.copy()
    W = np.zeros_like(left)
    for number, rows in enumerate(orders):
        scaled = J[rows] / scales[rows][:, None]
        reached = left @ scaled.T
        Q = reached @ soft_inverse(scaled @ reached) @ reached.T
        left -= Q
        W += Q / firmness(number, len(orders))
    return W + 0.5 * (left + left.T)


def firmness(order: int, count: int) -> float:
    """Return w_l of an order: the last one gives way like the null space, the first hardly."""
    if order == count - 1:
        return 1.0
    return FIRM if order == 0 else STEP ** (count - 1 - order)
