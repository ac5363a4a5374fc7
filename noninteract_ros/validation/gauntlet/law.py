# SPDX-License-Identifier: Apache-2.0
"""The laws in compiled form for references at rest; tests compare them with the controller.

Torque of all laws: J' (F_n + sigma F_a) + g with F_n = -(d D de/dt + nu K e) and F_a the force of
complete decoupling beyond the natural law, Lambda (a_non - a_nat).
"""

from typing import NamedTuple

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.validation.gauntlet.arrays import (
    TeamArrays,
    compiled,
    congruent,
    dot,
    inverted,
    multiply,
    put,
    quadratic,
    times,
    transposed,
)
from noninteract_ros.validation.gauntlet.planar import (
    arm_coriolis,
    arm_gravitational_energy,
    arm_gravity,
    arm_inertia,
    arm_jacobian,
    arm_jacobian_rate,
    arm_tool,
)

KINETIC, GRAVITATIONAL = 0, 1  # places in `energies`


class Terms(NamedTuple):
    """Terms of a team at a state; overwritten at every tick.

    Attributes:
        e: Error x - x_d, shape (n,).
        e_rate: Its rate, shape (n,).
        J: Task Jacobian, shape (n, n).
        inertia: Lambda, shape (n, n).
        inverse: Lambda^-1, shape (n, n).
        mixed: Lambda blkdiag(M_i)^-1, shape (n, n).
        coriolis: mu, shape (n, n).
        gravity: Gravity torque, shape (n,).
        energies: Kinetic energy and gravitational energy [J].
        tools: Tool Jacobian, inertia and Coriolis matrix at the tools, shape (3, n, n).
        spare: Work space, shape (4, n).
    """

    e: Array
    e_rate: Array
    J: Array
    inertia: Array
    inverse: Array
    mixed: Array
    coriolis: Array
    gravity: Array
    energies: Array
    tools: tuple[Array, Array, Array, Array]
    spare: tuple[Array, Array, Array, Array]


def new_terms(team: TeamArrays) -> Terms:
    """Allocate terms, with the constant terms of point masses."""
    n = team.n
    inertia = team.S.T @ np.diag(team.masses) @ team.S
    inverse, mixed = np.zeros((n, n)), np.zeros((n, n))
    if not len(team.arms):
        inverse = team.mixing @ np.diag(1.0 / team.masses) @ team.mixing.T
        for block in (slice(0, team.first), slice(team.first, n)):
            mixed[:, block] = inertia[:, block] @ np.linalg.inv(inertia[block, block])
    return Terms(
        np.zeros(n),
        np.zeros(n),
        team.mixing.copy(),
        np.ascontiguousarray(inertia),
        inverse,
        mixed,
        np.zeros((n, n)),
        np.zeros(n),
        np.zeros(2),
        (np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))),
        (np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)),
    )


@compiled
def observe(team: TeamArrays, terms: Terms, q: Array, v: Array) -> None:
    """Write the terms of a state of the plant."""
    if len(team.arms):
        arms_at(team, terms, q, v)
        return
    multiply(team.mixing, q, terms.e)
    multiply(team.mixing, v, terms.e_rate)
    kinetic = 0.0
    for i in range(team.n):
        kinetic += 0.5 * team.masses[i] * v[i] ** 2
    terms.energies[KINETIC] = kinetic


@compiled
def arms_at(team: TeamArrays, terms: Terms, q: Array, v: Array) -> None:
    """Write the terms of planar arms, with their inertia at the tools."""
    at_tools(team, terms, q, v)
    tool_jacobian, inertia, lightness, coriolis = terms.tools
    multiply(team.mixing, terms.spare[0], terms.e)
    multiply(tool_jacobian, v, terms.spare[1])
    multiply(team.mixing, terms.spare[1], terms.e_rate)
    congruent(team.S, inertia, terms.inertia)
    congruent(team.S, coriolis, terms.coriolis)
    for i in range(4):
        for j in range(4):
            terms.J[i, j] = terms.inverse[i, j] = 0.0
            for k in range(4):
                terms.J[i, j] += team.mixing[i, k] * tool_jacobian[k, j]
                for m in range(4):
                    weight = team.mixing[i, k] * team.mixing[j, m]
                    terms.inverse[i, j] += weight * lightness[k, m]
    L = terms.inertia
    for at in (0, 2):
        B = inverted((L[at, at], L[at, at + 1], L[at + 1, at], L[at + 1, at + 1]))
        for i in range(4):
            terms.mixed[i, at] = L[i, at] * B[0] + L[i, at + 1] * B[2]
            terms.mixed[i, at + 1] = L[i, at] * B[1] + L[i, at + 1] * B[3]


@compiled
def at_tools(team: TeamArrays, terms: Terms, q: Array, v: Array) -> None:
    """Write tool matrices, tool coordinates (into spare), gravity and energies of arms."""
    terms.energies[KINETIC] = terms.energies[GRAVITATIONAL] = 0.0
    for i in range(len(team.arms)):
        at = 2 * i
        J, M = arm_jacobian(team.arms, i, q), arm_inertia(team.arms, i, q)
        back = inverted(J)
        C, rate = arm_coriolis(team.arms, i, q, v), arm_jacobian_rate(team.arms, i, q, v)
        D = times(M, times(back, rate))
        turning = (C[0] - D[0], C[1] - D[1], C[2] - D[2], C[3] - D[3])
        put(terms.tools[0], at, J)
        put(terms.tools[1], at, times(transposed(back), times(M, back)))
        put(terms.tools[2], at, times(J, times(inverted(M), transposed(J))))
        put(terms.tools[3], at, times(transposed(back), times(turning, back)))
        x, y = arm_tool(team.arms, i, q)
        terms.spare[0][at], terms.spare[0][at + 1] = x - team.y_ref[at], y - team.y_ref[at + 1]
        terms.gravity[at], terms.gravity[at + 1] = arm_gravity(team.arms, i, q)
        w = v[at] * M[0] + v[at + 1] * M[2], v[at] * M[1] + v[at + 1] * M[3]
        terms.energies[KINETIC] += 0.5 * (w[0] * v[at] + w[1] * v[at + 1])
        terms.energies[GRAVITATIONAL] += arm_gravitational_energy(team.arms, i, q)


@compiled
def impedance_force(
    team: TeamArrays, terms: Terms, nu: float, damping: float, force: Array
) -> None:
    """Write F_n with the gates of springs and dampers."""
    for i in range(team.n):
        damped, pulled = team.damping[i] * terms.e_rate[i], team.stiffness[i] * terms.e[i]
        force[i] = -(damping * damped + nu * pulled)


@compiled
def complete_force(team: TeamArrays, terms: Terms, paper: bool, pull: Array, force: Array) -> None:
    """force = F_a = Lambda (a_non - a_nat) of complete decoupling.

    Args:
        team: The robots.
        terms: Terms of the state.
        paper: True to keep the paper's C_s,ii instead of C~_i.
        pull: F_n, shape (n,).
        force: Result, shape (n,).
    """
    n = team.n
    if not len(team.arms):
        multiply(terms.mixed, pull, force)
        for i in range(n):
            force[i] -= pull[i]
        return
    left, own, drift, slowed = terms.spare
    for at in (0, 2):
        for i in range(n):
            own[i] = terms.e_rate[i] if at <= i < at + 2 else 0.0
        multiply(terms.coriolis, own, drift)
        if paper:
            multiply(terms.inverse, drift, slowed)
            for i in (at, at + 1):
                drift[i] = (
                    terms.inertia[i, at] * slowed[at] + terms.inertia[i, at + 1] * slowed[at + 1]
                )
        left[at], left[at + 1] = pull[at] - drift[at], pull[at + 1] - drift[at + 1]
    multiply(terms.mixed, left, force)
    multiply(terms.coriolis, terms.e_rate, drift)
    for i in range(n):
        force[i] += drift[i] - pull[i]


@compiled
def potential(team: TeamArrays, terms: Terms) -> float:
    """Return U(e) of linear springs [J]."""
    total = 0.0
    for i in range(team.n):
        total += 0.5 * team.stiffness[i] * terms.e[i] ** 2
    return total


@compiled
def storage(team: TeamArrays, terms: Terms) -> float:
    """Return V_s, the sum of the subtasks' storage functions [J]."""
    coupled = 0.0
    for i in range(team.first):
        for j in range(team.first, team.n):
            coupled += terms.e_rate[i] * terms.inertia[i, j] * terms.e_rate[j]
    kinetic = 0.5 * quadratic(terms.inertia, terms.e_rate)
    return potential(team, terms) + kinetic - coupled


@compiled
def power(team: TeamArrays, terms: Terms, force: Array) -> float:
    """Return the power of a task force [W]."""
    return dot(terms.e_rate, force, team.n)
