# SPDX-License-Identifier: Apache-2.0
"""Plants with a zero-order hold of the torque, in compiled form, with their dissipated energy.

Linear plants use the exact discretization. Plants with contacts use an implicit midpoint rule with
discrete gradients of the contact forces, which conserves energy to rounding. Planar arms use
Runge-Kutta; their energy error is measured at every tick.
"""

from typing import NamedTuple

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.validation.gauntlet.arrays import (
    SurroundingsArrays,
    TeamArrays,
    add_scaled,
    compiled,
    congruent,
    copy,
    dot,
    multiply,
    multiply_transposed,
    quadratic,
    row_dot,
    solve_in_place,
)
from noninteract_ros.validation.gauntlet.planar import (
    arm_coriolis,
    arm_gravity,
    arm_inertia,
    arm_jacobian,
    arm_jacobian_rate,
    arm_tool,
)

LINEAR, CONTACT, ARMS = 0, 1, 2  # kinds of plants
ROUNDS = 8  # fixed-point iterations of contact forces; each gains three digits or more
STAGES = np.array([[0.0, 1.0], [0.5, 2.0], [0.5, 2.0], [1.0, 1.0]])  # of Runge and Kutta


class PlantArrays(NamedTuple):
    """Matrices of one tick; m coordinates z, w = (z, dz/dt, torque, 1).

    Attributes:
        kind: LINEAR, CONTACT or ARMS.
        substeps: Integration steps per tick of inexact plants.
        tick: w -> (z, dz/dt) a tick later, shape (2 m, 2 m + n + 1).
        loss: Heat of a tick as a quadratic form of w.
        response: Midpoint velocity by impulse over a substep, shape (m, m).
        inertia: Robots, carried masses and bodies, shape (m, m); of arms without the arms.
        vectors: Work space for vectors, shape (m,) each.
        long: Work space for w and its image.
        square: Work space for matrices, shape (m, m) each.
        contacts: Work space for force and depth of each contact.
    """

    kind: int
    substeps: int
    tick: Array
    loss: Array
    response: Array
    inertia: Array
    vectors: tuple[Array, ...]
    long: tuple[Array, Array]
    square: tuple[Array, Array]
    contacts: tuple[Array, Array]


@compiled
def linear_tick(plant: PlantArrays, z: Array, z_rate: Array, torque: Array) -> float:
    """Advance a linear plant by one tick in place; return the heat [J]."""
    m, n = len(z), len(torque)
    w, after = plant.long
    for i in range(m):
        w[i], w[m + i] = z[i], z_rate[i]
    for i in range(n):
        w[2 * m + i] = torque[i]
    w[2 * m + n] = 1.0
    multiply(plant.tick, w, after)
    for i in range(m):
        z[i], z_rate[i] = after[i], after[m + i]
    return quadratic(plant.loss, w)


@compiled
def contact_force(stiffness: float, before: float, way: float) -> float:
    """Return the mean contact force over a step: change of energy per distance [N]."""
    deep, deeper = max(before, 0.0), max(before + way, 0.0)
    if abs(way) < 1e-13:
        return -stiffness * deep
    return -0.5 * stiffness * (deeper * deeper - deep * deep) / way


@compiled
def contact_tick(
    plant: PlantArrays,
    around: SurroundingsArrays,
    T: float,
    z: Array,
    z_rate: Array,
    torque: Array,
) -> float:
    """Advance a plant with unilateral contacts by one tick in place; return the heat [J]."""
    h, heat, m, n = T / plant.substeps, 0.0, len(z), len(torque)
    push, load, middle, spring = (
        plant.vectors[0],
        plant.vectors[1],
        plant.vectors[2],
        plant.vectors[3],
    )
    forces, depth = plant.contacts
    for _ in range(plant.substeps):
        multiply(plant.inertia, z_rate, push)
        multiply(around.stiffness, z, spring)
        for i in range(m):
            push[i] = 2.0 / h * push[i] - spring[i] + around.rest[i]
            if i < n:
                push[i] += torque[i]
        for i in range(len(depth)):
            depth[i] = row_dot(around.directions, i, z) - around.gaps[i]
            forces[i] = 0.0
        for _ in range(ROUNDS):
            multiply_transposed(around.directions, forces, load)
            add_scaled(push, 1.0, load, load)
            multiply(plant.response, load, middle)
            for i in range(len(depth)):
                way = h * row_dot(around.directions, i, middle)
                forces[i] = contact_force(around.contact_stiffness[i], depth[i], way)
        heat += h * quadratic(around.damping, middle)
        for i in range(m):
            z[i] += h * middle[i]
            z_rate[i] = 2.0 * middle[i] - z_rate[i]
    return heat


@compiled
def touching(around: SurroundingsArrays, z: Array, force: Array) -> float:
    """Write the force of springs and contacts, shape (m,); return their energy [J]."""
    multiply(around.stiffness, z, force)
    energy = around.preload
    for i in range(len(force)):
        energy += z[i] * (0.5 * force[i] - around.rest[i])
        force[i] = around.rest[i] - force[i]
    for i in range(len(around.gaps)):
        depth = row_dot(around.directions, i, z) - around.gaps[i]
        if depth > 0.0:
            energy += 0.5 * around.contact_stiffness[i] * depth * depth
            for j in range(len(force)):
                force[j] -= around.contact_stiffness[i] * depth * around.directions[i, j]
    return energy


@compiled
def tool_motion(
    team: TeamArrays, q: Array, v: Array, z: Array, z_rate: Array, J: Array, bias: Array
) -> None:
    """Write z, dz/dt, its Jacobian and d2z/dt2 at constant velocity, of arms and bodies."""
    for i in range(len(q)):
        z[i], z_rate[i], bias[i] = q[i], v[i], 0.0
        for j in range(len(q)):
            J[i, j] = 1.0 if i == j else 0.0
    for i in range(len(team.arms)):
        a, b = 2 * i, 2 * i + 1
        B, R = arm_jacobian(team.arms, i, q), arm_jacobian_rate(team.arms, i, q, v)
        x, y = arm_tool(team.arms, i, q)
        z[a], z[b] = x - team.y_ref[a], y - team.y_ref[b]
        J[a, a], J[a, b], J[b, a], J[b, b] = B
        z_rate[a], z_rate[b] = B[0] * v[a] + B[1] * v[b], B[2] * v[a] + B[3] * v[b]
        bias[a], bias[b] = R[0] * v[a] + R[1] * v[b], R[2] * v[a] + R[3] * v[b]


@compiled
def arms_acceleration(
    plant: PlantArrays,
    team: TeamArrays,
    around: SurroundingsArrays,
    q: Array,
    v: Array,
    torque: Array,
    acceleration: Array,
) -> float:
    """Write the acceleration of joints and bodies; return the dissipated power [W]."""
    z, z_rate, bias, force = plant.vectors[0], plant.vectors[1], plant.vectors[2], plant.vectors[3]
    J, M = plant.square
    tool_motion(team, q, v, z, z_rate, J, bias)
    touching(around, z, force)
    multiply(around.inertia, bias, acceleration)
    add_scaled(force, -1.0, acceleration, force)
    multiply(around.damping, z_rate, acceleration)
    add_scaled(force, -1.0, acceleration, force)
    heating = dot(z_rate, acceleration, len(q))
    multiply_transposed(J, force, acceleration)
    congruent(J, around.inertia, M)
    for i in range(len(team.arms)):
        a, b = 2 * i, 2 * i + 1
        own = arm_inertia(team.arms, i, q)
        M[a, a], M[b, a], M[b, b] = M[a, a] + own[0], M[b, a] + own[2], M[b, b] + own[3]
        C, g = arm_coriolis(team.arms, i, q, v), arm_gravity(team.arms, i, q)
        acceleration[a] += torque[a] - g[0] - C[0] * v[a] - C[1] * v[b]
        acceleration[b] += torque[b] - g[1] - C[2] * v[a] - C[3] * v[b]
    solve_in_place(M, acceleration)
    return heating


@compiled
def arms_tick(
    plant: PlantArrays,
    team: TeamArrays,
    around: SurroundingsArrays,
    T: float,
    q: Array,
    v: Array,
    torque: Array,
) -> float:
    """Advance planar arms by one tick in place (classical Runge-Kutta); return the heat [J]."""
    h, heat, m = T / plant.substeps, 0.0, len(q)
    at, rate, slope = plant.vectors[4], plant.vectors[5], plant.vectors[6]
    q_sum, v_sum = plant.long
    for _ in range(plant.substeps):
        for i in range(m):
            q_sum[i] = v_sum[i] = slope[i] = rate[i] = 0.0
        for stage in range(4):
            reach, weight = STAGES[stage, 0] * h, STAGES[stage, 1] * h / 6.0
            for i in range(m):
                at[i] = q[i] + reach * rate[i]
                rate[i] = v[i] + reach * slope[i]
            heat += weight * arms_acceleration(plant, team, around, at, rate, torque, slope)
            for i in range(m):
                q_sum[i] += weight * rate[i]
                v_sum[i] += weight * slope[i]
        add_scaled(q, 1.0, q_sum, q)
        add_scaled(v, 1.0, v_sum, v)
    return heat


@compiled
def advance(
    plant: PlantArrays,
    team: TeamArrays,
    around: SurroundingsArrays,
    T: float,
    q: Array,
    v: Array,
    torque: Array,
) -> float:
    """Advance a plant by one tick in place; return the heat [J]."""
    if plant.kind == LINEAR:
        return linear_tick(plant, q, v, torque)
    if plant.kind == CONTACT:
        return contact_tick(plant, around, T, q, v, torque)
    return arms_tick(plant, team, around, T, q, v, torque)


@compiled
def environment_energy(
    plant: PlantArrays, team: TeamArrays, around: SurroundingsArrays, q: Array, v: Array
) -> tuple[float, float]:
    """Return potential and kinetic energy of the environment [J]."""
    z, z_rate = plant.vectors[0], plant.vectors[1]
    if plant.kind == ARMS:
        tool_motion(team, q, v, z, z_rate, plant.square[0], plant.vectors[2])
    else:
        copy(q, z)
        copy(v, z_rate)
    return touching(around, z, plant.vectors[3]), 0.5 * quadratic(around.inertia, z_rate)
