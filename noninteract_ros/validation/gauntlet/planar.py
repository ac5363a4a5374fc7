# SPDX-License-Identifier: Apache-2.0
"""Closed-form dynamics of planar two-link arms, compiled; arm i has joints 2 i and 2 i + 1.

M = [[alpha + 2 beta c, delta + beta c], [., delta]], c = cos q_2, C from Christoffel's symbols,
potential energy gamma_1 sin q_1 + gamma_2 sin(q_1 + q_2); `TeamArrays.arms` holds the parameters.
"""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.validation.gauntlet.arrays import Block, compiled


@compiled
def arm_inertia(arms: Array, i: int, q: Array) -> Block:
    """Return M."""
    bent = arms[i, 3] * np.cos(q[2 * i + 1])
    mixed = arms[i, 4] + bent
    return (arms[i, 2] + 2.0 * bent, mixed, mixed, arms[i, 4])


@compiled
def arm_coriolis(arms: Array, i: int, q: Array, v: Array) -> Block:
    """Return C."""
    turning = arms[i, 3] * np.sin(q[2 * i + 1])
    both = v[2 * i] + v[2 * i + 1]
    return (-turning * v[2 * i + 1], -turning * both, turning * v[2 * i], 0.0)


@compiled
def arm_gravity(arms: Array, i: int, q: Array) -> tuple[float, float]:
    """Return the gravity torque [N m]."""
    outer = arms[i, 6] * np.cos(q[2 * i] + q[2 * i + 1])
    return (arms[i, 5] * np.cos(q[2 * i]) + outer, outer)


@compiled
def arm_gravitational_energy(arms: Array, i: int, q: Array) -> float:
    """Return the gravitational energy [J]."""
    return float(arms[i, 5] * np.sin(q[2 * i]) + arms[i, 6] * np.sin(q[2 * i] + q[2 * i + 1]))


@compiled
def arm_tool(arms: Array, i: int, q: Array) -> tuple[float, float]:
    """Return the tool point in the base frame [m]."""
    a, b = q[2 * i], q[2 * i] + q[2 * i + 1]
    l1, l2 = arms[i, 0], arms[i, 1]
    return (l1 * np.cos(a) + l2 * np.cos(b), l1 * np.sin(a) + l2 * np.sin(b))


@compiled
def arm_jacobian(arms: Array, i: int, q: Array) -> Block:
    """Return the Jacobian of the tool point."""
    a, b = q[2 * i], q[2 * i] + q[2 * i + 1]
    l1, l2 = arms[i, 0], arms[i, 1]
    x, y = -l2 * np.sin(b), l2 * np.cos(b)
    return (x - l1 * np.sin(a), x, y + l1 * np.cos(a), y)


@compiled
def arm_jacobian_rate(arms: Array, i: int, q: Array, v: Array) -> Block:
    """Return the time derivative of the Jacobian."""
    a, b = q[2 * i], q[2 * i] + q[2 * i + 1]
    near, far = arms[i, 0] * v[2 * i], arms[i, 1] * (v[2 * i] + v[2 * i + 1])
    x, y = -far * np.cos(b), -far * np.sin(b)
    return (x - near * np.cos(a), x, y - near * np.sin(a), y)
