# SPDX-License-Identifier: Apache-2.0
"""Multipliers of inequality constraints, by an active-set method in the dual."""

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.compiler import compiled, inner

Flags = NDArray[np.bool_]
TOLERANCE = 1e-10  # relative to the largest demand
SMALLEST = 1e-300  # pivot of a factor


@compiled
def multipliers(G: Array, demand: Array, found: Array) -> bool:
    """Minimise l'G l / 2 - demand'l over l >= 0.

    Constraints are added one at a time, the most violated first. Where the solution on the active
    ones has a negative multiplier, the step ends where the first one reaches zero, and that
    constraint leaves.

    Args:
        G: Positive definite, with ones on its diagonal, shape (m, m).
        demand: Shape (m,).
        found: Start, shape (m,); overwritten with the solution.

    Returns:
        False where it was stopped after too many changes.
    """
    m = len(demand)
    active = found > 0.0
    found[:] = np.where(active, found, 0.0)
    tolerance = TOLERANCE * (1.0 + np.abs(demand).max())
    for _ in range(6 * m + 10):
        if not _settle(G, demand, found, active):
            return False
        worst, entering = tolerance, -1
        for i in range(m):
            if not active[i]:
                missing = demand[i]
                for j in range(m):
                    missing -= G[i, j] * found[j]
                if missing > worst:
                    worst, entering = missing, i
        if entering < 0:
            return True
        active[entering] = True
    return False


@inner
def _settle(G: Array, demand: Array, found: Array, active: Flags) -> bool:
    """Solves on the active constraints, without those whose multipliers would be negative."""
    m = len(demand)
    for _ in range(2 * m + 2):
        wanted = _solved(G, demand, active)
        share, leaving = 1.0, -1
        for i in range(m):
            if active[i] and wanted[i] <= 0.0:
                gap = found[i] - wanted[i]
                reached = found[i] / gap if gap > 0.0 else 0.0
                if reached < share or leaving < 0:
                    share, leaving = reached, i
        for i in range(m):
            found[i] += share * (wanted[i] - found[i])
        if leaving < 0:
            return True
        active[leaving], found[leaving] = False, 0.0
    return False


@inner
def _solved(G: Array, demand: Array, active: Flags) -> Array:
    """Solution of G l = demand on the active constraints, zero elsewhere, by Cholesky."""
    m = len(demand)
    rows = np.flatnonzero(active)
    k = len(rows)
    L, y, result = np.zeros((k, k)), np.zeros(k), np.zeros(m)
    for a in range(k):
        total = demand[rows[a]]
        for b in range(a + 1):
            s = G[rows[a], rows[b]]
            for c in range(b):
                s -= L[a, c] * L[b, c]
            L[a, b] = np.sqrt(max(s, SMALLEST)) if a == b else s / L[b, b]
        for c in range(a):
            total -= L[a, c] * y[c]
        y[a] = total / L[a, a]
    for a in range(k - 1, -1, -1):
        total = y[a]
        for c in range(a + 1, k):
            total -= L[c, a] * result[rows[c]]
        result[rows[a]] = total / L[a, a]
    return result
