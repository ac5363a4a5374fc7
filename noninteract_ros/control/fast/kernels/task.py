# SPDX-License-Identifier: Apache-2.0
"""Operations of `control.fast.robotwise_dynamics.RobotwiseDynamics`, one call each.

J = A T, and no matrix over the whole team is formed, as described there. G_inverse is the inverse
of the sum of all G_k of the mixing, shape (1, h, h).
"""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.compiler import FIRST, compiled, inner
from noninteract_ros.control.fast.kernels.array_parts import (
    MixingArrays,
    Plan,
    RobotArrays,
    mixing_arrays,
    robot_arrays,
)
from noninteract_ros.control.fast.kernels.blocks import (
    add_product,
    factorize,
    product,
    solve,
    transposed_product,
)
from noninteract_ros.control.fast.kernels.mixing import (
    add_mix_rate,
    inverse_squares,
    mix,
    mix_transposed,
    unmix,
    unmix_transposed,
)
from noninteract_ros.control.fast.kernels.vectors import (
    column,
    first_column,
    joined,
    mixed,
    own_joints,
    picked,
    split,
    spread,
    team_joints,
    times,
)


@compiled
def velocity(plan: Plan, blocks: Array, mixers: Array, v: Array) -> Array:
    """Return J v, shape (n,)."""
    terms, A = robot_arrays(blocks), mixing_arrays(mixers)
    return first_column(mixed(plan, A, times(terms.T, own_joints(plan, terms, v))))


@compiled
def acceleration_of(plan: Plan, blocks: Array, mixers: Array, v: Array, a: Array) -> Array:
    """Return J a + (dJ/dt) v, shape (n,), with (dJ/dt) v = (dA/dt) T v + A (dT/dt) v."""
    terms, A = robot_arrays(blocks), mixing_arrays(mixers)
    h = A.G.shape[1]
    v_own = own_joints(plan, terms, v)
    moved = times(terms.T, own_joints(plan, terms, a))
    for k in range(len(moved)):
        add_product(1.0, terms.T_rate, k, v_own, k, moved, k)
    c, r = np.empty((1, h, 1)), np.empty((len(plan.steps), h, 1))
    mix(plan.steps, plan.framed, A, moved, c, r)
    add_mix_rate(1.0, plan.steps, plan.framed, A, times(terms.T, v_own), c, r)
    return first_column(joined(plan, c, r, moved))


@compiled
def joint_acceleration(
    plan: Plan, blocks: Array, mixers: Array, G_inverse: Array, v: Array, wanted: Array
) -> Array:
    """Return S (a - (dJ/dt) v), shape (n,)."""
    terms, A = robot_arrays(blocks), mixing_arrays(mixers)
    h = A.G.shape[1]
    v_own = own_joints(plan, terms, v)
    own = times(terms.T, v_own)
    c, r = np.zeros((1, h, 1)), np.zeros((len(plan.steps), h, 1))
    add_mix_rate(-1.0, plan.steps, plan.framed, A, own, c, r)
    left = column(wanted) + joined(plan, c, r, np.zeros(own.shape))
    split(plan, left, c, r, own)
    unmix(plan.steps, plan.framed, A, G_inverse, c, r, own)
    for k in range(len(own)):
        add_product(-1.0, terms.T_rate, k, v_own, k, own, k)
    return team_joints(plan, times(terms.T_inverse, own))


@inner
def coriolis(
    plan: Plan, terms: RobotArrays, A: MixingArrays, G_inverse: Array, e_rates: Array
) -> Array:
    """Return mu e_rates with mu = S' (C S + M dS/dt), dS/dt = -S (dJ/dt) S, shape (n, s)."""
    N, m = terms.M.shape[0], terms.M.shape[1]
    h, s = A.G.shape[1], e_rates.shape[1]
    c, r = np.empty((1, h, s)), np.empty((N - 1, h, s))
    own, turned = np.empty((N, m, s)), np.zeros((N, m, s))
    split(plan, e_rates, c, r, own)
    unmix(plan.steps, plan.framed, A, G_inverse, c, r, own)
    c, r = np.zeros(c.shape), np.zeros(r.shape)
    add_mix_rate(1.0, plan.steps, plan.framed, A, own, c, r)
    unmix(plan.steps, plan.framed, A, G_inverse, c, r, turned)
    force, moved = np.empty((1, m, s)), np.empty((1, m, s))
    for k in range(N):
        product(terms.T_inverse, k, own, k, moved, FIRST)
        add_product(1.0, terms.T_rate, k, moved, FIRST, turned, k)
        product(terms.C, k, moved, FIRST, force, FIRST)
        product(terms.T_inverse, k, turned, k, moved, FIRST)
        add_product(-1.0, terms.M, k, moved, FIRST, force, FIRST)
        transposed_product(terms.T_inverse, k, force, FIRST, own, k)
    unmix_transposed(plan.steps, plan.framed, A, G_inverse, own, c, r)
    return joined(plan, c, r, own)


@compiled
def coriolis_force(
    plan: Plan, blocks: Array, mixers: Array, G_inverse: Array, e_rate: Array
) -> Array:
    """Return C~_i e_rate_i of each subtask, shape (n,)."""
    terms, A = robot_arrays(blocks), mixing_arrays(mixers)
    return picked(plan, coriolis(plan, terms, A, G_inverse, spread(plan, e_rate)))


@compiled
def natural_coriolis_force(
    plan: Plan, blocks: Array, mixers: Array, G_inverse: Array, e_rate: Array
) -> Array:
    """Return mu e_rate, shape (n,)."""
    terms, A = robot_arrays(blocks), mixing_arrays(mixers)
    return first_column(coriolis(plan, terms, A, G_inverse, column(e_rate)))


@compiled
def torque(plan: Plan, blocks: Array, g: Array, v: Array, a: Array) -> Array:
    """Return M a + C v + g, shape (n,)."""
    terms = robot_arrays(blocks)
    v_own = own_joints(plan, terms, v)
    force = times(terms.M, own_joints(plan, terms, a))
    for k in range(len(force)):
        add_product(1.0, terms.C, k, v_own, k, force, k)
    result = team_joints(plan, force)
    for i in range(len(g)):
        result[i] += g[i]
    return result


@compiled
def acceleration_under(plan: Plan, blocks: Array, mixers: Array, torque: Array) -> Array:
    """Return J M^-1 tau, shape (n,)."""
    terms, A = robot_arrays(blocks), mixing_arrays(mixers)
    own, M = own_joints(plan, terms, torque), terms.M.copy()
    for k in range(len(own)):
        factorize(M, k)
        solve(M, k, own, k)
    return first_column(mixed(plan, A, times(terms.T, own)))


@inner
def multiplied(
    plan: Plan, terms: RobotArrays, A: MixingArrays, G_inverse: Array, columns: Array
) -> Array:
    """Return Lambda a = A^-T L A^-1 a of columns, shape (n, s)."""
    N, h, s = len(terms.M), A.G.shape[1], columns.shape[1]
    c, r, own = np.empty((1, h, s)), np.empty((N - 1, h, s)), np.empty((N, terms.M.shape[1], s))
    split(plan, columns, c, r, own)
    unmix(plan.steps, plan.framed, A, G_inverse, c, r, own)
    force = times(terms.L, own)
    unmix_transposed(plan.steps, plan.framed, A, G_inverse, force, c, r)
    return joined(plan, c, r, force)


@compiled
def multiply_by_inertias(
    plan: Plan, blocks: Array, mixers: Array, G_inverse: Array, a: Array
) -> Array:
    """Return S_i' M S_i a_i of each subtask, shape (n,)."""
    terms, A = robot_arrays(blocks), mixing_arrays(mixers)
    return picked(plan, multiplied(plan, terms, A, G_inverse, spread(plan, a)))


@compiled
def multiply_by_inertia(
    plan: Plan, blocks: Array, mixers: Array, G_inverse: Array, a: Array
) -> Array:
    """Return Lambda a, shape (n,)."""
    terms, A = robot_arrays(blocks), mixing_arrays(mixers)
    return first_column(multiplied(plan, terms, A, G_inverse, column(a)))


@compiled
def force_of(plan: Plan, blocks: Array, mixers: Array, G_inverse: Array, torque: Array) -> Array:
    """Return S' tau = A^-T T^-T tau, shape (n,)."""
    terms, A = robot_arrays(blocks), mixing_arrays(mixers)
    h, joints = A.G.shape[1], own_joints(plan, terms, torque)
    force = np.empty(joints.shape)
    for k in range(len(force)):
        transposed_product(terms.T_inverse, k, joints, k, force, k)
    c, r = np.empty((1, h, 1)), np.empty((len(plan.steps), h, 1))
    unmix_transposed(plan.steps, plan.framed, A, G_inverse, force, c, r)
    return first_column(joined(plan, c, r, force))


@compiled
def divide_by_inertia(plan: Plan, blocks: Array, mixers: Array, force: Array) -> Array:
    """Return Lambda^-1 f = A L^-1 A' f, shape (n,)."""
    terms, A = robot_arrays(blocks), mixing_arrays(mixers)
    N, h = len(terms.M), A.G.shape[1]
    c, r, own = np.empty((1, h, 1)), np.empty((N - 1, h, 1)), np.empty((N, terms.M.shape[1], 1))
    split(plan, column(force), c, r, own)
    mix_transposed(plan.steps, plan.framed, A, c, r, own)
    L = terms.L.copy()
    for k in range(N):
        factorize(L, k)
        solve(L, k, own, k)
    return first_column(mixed(plan, A, own))


@compiled
def inverse_norm(plan: Plan, blocks: Array, mixers: Array, G_inverse: Array) -> float:
    """Return the Frobenius norm of S, not finite for singular T."""
    terms, A = robot_arrays(blocks), mixing_arrays(mixers)
    squares = inverse_squares(plan.steps, A, G_inverse)
    m, h, total = terms.M.shape[1], A.G.shape[1], 0.0
    for k in range(len(terms.M)):
        for row in range(m):
            for i in range(h):
                for j in range(h):
                    weight = terms.T_inverse[k, row, i] * terms.T_inverse[k, row, j]
                    total += weight * squares[k, i, j]
    for place in plan.chosen:
        for row in range(m):
            total += terms.T_inverse[place // m, row, place % m] ** 2
    return np.sqrt(total if total > 0.0 else 0.0)
