# SPDX-License-Identifier: Apache-2.0
"""Division of forces by the inertia of each decoupled subtask, M_i = S_i' M S_i."""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.compiler import FIRST, compiled, inner
from noninteract_ros.control.fast.kernels.array_parts import (
    EDGES,
    MEAN,
    MixingArrays,
    Plan,
    mixing_arrays,
    robot_arrays,
)
from noninteract_ros.control.fast.kernels.blocks import (
    add_product,
    add_transposed_product,
    cut,
    factorize,
    product,
    solve,
)


@compiled
def divide_by_inertias(plan: Plan, blocks: Array, mixers: Array, force: Array) -> Array:
    """Return M_i^-1 f_i of each subtask, shape (n,)."""
    L, A = robot_arrays(blocks).L, mixing_arrays(mixers)
    result = np.empty(len(force))
    for part in range(len(plan.parts)):
        role, lo, hi = plan.parts[part, 0], plan.parts[part, 1], plan.parts[part, 2]
        if role == MEAN:
            _divide_mean(plan, L, A, lo, hi, force, result)
        elif role == EDGES:
            _divide_edges(plan, L, A, lo, hi, force, result)
        else:
            _divide_joints(plan, L, A, lo, hi, force, result)
    return result


@inner
def _divide_mean(
    plan: Plan, L: Array, A: MixingArrays, lo: int, hi: int, force: Array, result: Array
) -> None:
    """Write M_c^-1 f with M_c = B' L B, for the mean's coordinates lo to hi."""
    h, p = A.B.shape[1], hi - lo
    M, B, pushed = np.zeros((1, p, p)), np.empty((1, h, p)), np.empty((1, h, p))
    tools, x = np.empty((1, h, h)), np.empty((1, p, 1))
    for k in range(len(L)):
        cut(L, k, FIRST, tools, FIRST)
        for i in range(h):
            for j in range(p):
                B[0, i, j] = A.B[k, i, lo + j]
        product(tools, FIRST, B, FIRST, pushed, FIRST)
        add_transposed_product(1.0, B, FIRST, pushed, FIRST, M, FIRST)
    for i in range(p):
        x[0, i, 0] = force[plan.order[lo + i]]
    factorize(M, FIRST)
    solve(M, FIRST, x, FIRST)
    for i in range(p):
        result[plan.order[lo + i]] = x[0, i, 0]


@inner
def _divide_edges(
    plan: Plan, L: Array, A: MixingArrays, lo: int, hi: int, force: Array, result: Array
) -> None:
    """Write M_r^-1 f for the edges' coordinates lo to hi.

    y = A_r w at the stationary point, with the mean held constant by multipliers.
    """
    N, h, p = len(L), A.G.shape[1], hi - lo
    G, K, F = np.empty((1, p, p)), np.empty((N, p, p)), np.empty((1, p, p))
    free, held, f = np.zeros((N, p, 1)), np.empty((N, p, p)), np.empty((1, p, 1))
    schur, multipliers = np.zeros((1, p, p)), np.zeros((1, p, 1))
    for step in range(len(plan.steps)):
        edge, side = plan.steps[step, 0], float(plan.steps[step, 3])
        cut(A.K, edge, lo, K, edge)
        for i in range(p):
            f[0, i, 0] = force[plan.order[h * (1 + edge) + lo + i]]
        add_transposed_product(side, K, edge, f, FIRST, free, plan.steps[step, 2])
        add_transposed_product(-side, K, edge, f, FIRST, free, plan.steps[step, 1])
    for k in range(N):
        cut(L, k, lo, F, FIRST)
        cut(A.G, k, lo, G, FIRST)
        for i in range(p):
            for j in range(p):
                held[k, i, j] = G[0, j, i]
        factorize(F, FIRST)
        solve(F, FIRST, held, k)
        solve(F, FIRST, free, k)
        add_product(1.0, G, FIRST, held, k, schur, FIRST)
        add_product(1.0, G, FIRST, free, k, multipliers, FIRST)
    factorize(schur, FIRST)
    solve(schur, FIRST, multipliers, FIRST)
    for k in range(N):
        add_product(-1.0, held, k, multipliers, FIRST, free, k)
    for step in range(len(plan.steps)):
        edge, side = plan.steps[step, 0], plan.steps[step, 3]
        for i in range(p):
            f[0, i, 0] = side * (free[plan.steps[step, 2], i, 0] - free[plan.steps[step, 1], i, 0])
        for i in range(p):
            total = 0.0
            for j in range(p):
                total += K[edge, i, j] * f[0, j, 0]
            result[plan.order[h * (1 + edge) + lo + i]] = total


@inner
def _divide_joints(
    plan: Plan, L: Array, A: MixingArrays, lo: int, hi: int, force: Array, result: Array
) -> None:
    """Write M_p^-1 f of the chosen joints lo to hi; only they move, so M_p is a block of L."""
    m, first = L.shape[1], len(L) * A.G.shape[1]
    while lo < hi:
        k, end = plan.chosen[lo] // m, lo + 1
        while end < hi and plan.chosen[end] // m == k:
            end += 1
        size = end - lo
        F, x = np.empty((1, size, size)), np.empty((1, size, 1))
        for i in range(size):
            x[0, i, 0] = force[plan.order[first + lo + i]]
            for j in range(size):
                F[0, i, j] = L[k, plan.chosen[lo + i] % m, plan.chosen[lo + j] % m]
        factorize(F, FIRST)
        solve(F, FIRST, x, FIRST)
        for i in range(size):
            result[plan.order[first + lo + i]] = x[0, i, 0]
        lo = end
