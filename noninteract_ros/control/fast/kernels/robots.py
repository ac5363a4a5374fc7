# SPDX-License-Identifier: Apache-2.0
"""Terms of the law from Pinocchio's results for each robot."""

from typing import NamedTuple

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.compiler import FIRST, compiled, inner
from noninteract_ros.control.fast.kernels.array_parts import Indices, Plan, robot_arrays
from noninteract_ros.control.fast.kernels.blocks import invert, product, transposed_product


class Tools(NamedTuple):
    """Constants of the tools.

    Attributes:
        rows: Axes in use, out of 0, 1 and 2, shape (a,).
        rotates: True if the tools' rotations are used.
        translations: Position of the tool in the last joint's frame, shape (N, 3) [m].
        rotations: Orientation of the tool, with its constant offset, shape (N, 3, 3).
        moves: 1 for each joint that moves its robot's tool, shape (N, m).
        chosen: T of the chosen joints and of the padding, zero elsewhere, shape (N, m, m).
    """

    rows: Indices
    rotates: bool
    translations: Array
    rotations: Array
    moves: Array
    chosen: Array


class Poses(NamedTuple):
    """Poses and Jacobians of the tools; overwritten at every tick.

    Attributes:
        jacobians: Twists per joint velocity in world axes, shape (N, 6, m).
        rates: Time derivatives of the Jacobians, shape (N, 6, m).
        positions: Tool points, shape (N, 3) [m].
        rotations: Tool orientations, shape (N, 3, 3).
        twists: Tool twists, shape (N, 6).
    """

    jacobians: Array
    rates: Array
    positions: Array
    rotations: Array
    twists: Array


@compiled
def gather(
    k: int,
    blocks: Array,
    poses: Poses,
    M: Array,
    C: Array,
    J: Array,
    J_rate: Array,
    translation: Array,
    rotation: Array,
) -> None:
    """Copy Pinocchio's results of robot k; Pinocchio fills the upper triangle of M only.

    Args:
        k: Index of the robot.
        blocks: Output: terms of all robots, shape (6, N, m, m), of which M and C are written.
        poses: Output: frames of the last joints, with twists at the world's origin.
        M: Inertia matrix, shape (n_k, n_k).
        C: Coriolis matrix, shape (n_k, n_k).
        J: Twists of the joints at the world's origin, shape (6, n_k).
        J_rate: Time derivative of J, shape (6, n_k).
        translation: Position of the last joint's frame, shape (3,).
        rotation: Orientation of the last joint's frame, shape (3, 3).
    """
    size = len(M)
    for i in range(size):
        for j in range(size):
            blocks[0, k, i, j] = M[min(i, j), max(i, j)]
            blocks[1, k, i, j] = C[i, j]
    for i in range(6):
        for j in range(size):
            poses.jacobians[k, i, j] = J[i, j]
            poses.rates[k, i, j] = J_rate[i, j]
    for i in range(3):
        poses.positions[k, i] = translation[i]
        for j in range(3):
            poses.rotations[k, i, j] = rotation[i, j]


@compiled
def robot_terms(plan: Plan, tools: Tools, poses: Poses, blocks: Array, v: Array) -> None:
    """Compute the terms of all robots, and move the results of `gather` to the tools.

    Args:
        plan: Index tables.
        tools: Constants of the tools.
        poses: Frames of the last joints on input, of the tools on output.
        blocks: Terms, shape (6, N, m, m); M and C are input, the others output.
        v: Velocity, shape (n,).
    """
    terms = robot_arrays(blocks)
    N, m = terms.M.shape[0], terms.M.shape[1]
    v_own, work = np.zeros((N, m)), np.empty((1, m, m))
    for i in range(len(v)):
        v_own[plan.joints[i] // m, plan.joints[i] % m] = v[i]
    for k in range(N):
        _move_frame(tools, poses, k)
        _move_twists(tools, poses, k, v_own)
        _put_own(tools, poses, k, terms.T, terms.T_rate)
        invert(terms.T, k, work, terms.T_inverse, k)
        product(terms.M, k, terms.T_inverse, k, work, FIRST)
        transposed_product(terms.T_inverse, k, work, FIRST, terms.L, k)


@inner
def _move_frame(tools: Tools, poses: Poses, k: int) -> None:
    """Move the frame of the last joint to the tool."""
    R, t = poses.rotations, tools.translations
    for i in range(3):
        x, y, z = R[k, i, 0], R[k, i, 1], R[k, i, 2]
        poses.positions[k, i] += x * t[k, 0] + y * t[k, 1] + z * t[k, 2]
        for j in range(3):
            to = tools.rotations
            R[k, i, j] = x * to[k, 0, j] + y * to[k, 1, j] + z * to[k, 2, j]


@inner
def _move_twists(tools: Tools, poses: Poses, k: int, v: Array) -> None:
    """Move twists from the world's origin to the tool point p: J + omega x p, and its rate."""
    J, J_rate, p, twist = poses.jacobians, poses.rates, poses.positions, poses.twists
    for row in range(5, -1, -1):
        a, b = (row + 1) % 3, (row + 2) % 3
        twist[k, row] = 0.0
        for i in range(v.shape[1]):
            if row < 3:
                J[k, row, i] += J[k, 3 + a, i] * p[k, b] - J[k, 3 + b, i] * p[k, a]
                J_rate[k, row, i] += J_rate[k, 3 + a, i] * p[k, b] - J_rate[k, 3 + b, i] * p[k, a]
            J[k, row, i] *= tools.moves[k, i]
            J_rate[k, row, i] *= tools.moves[k, i]
            twist[k, row] += J[k, row, i] * v[k, i]
    for row in range(3):
        a, b = (row + 1) % 3, (row + 2) % 3
        for i in range(v.shape[1]):
            J_rate[k, row, i] += J[k, 3 + a, i] * twist[k, b] - J[k, 3 + b, i] * twist[k, a]


@inner
def _put_own(tools: Tools, poses: Poses, k: int, T: Array, T_rate: Array) -> None:
    """Write T and its rate: velocity along the axes in use, R' omega, chosen joints."""
    J, J_rate, R, twist = poses.jacobians, poses.rates, poses.rotations, poses.twists
    a, m = len(tools.rows), T.shape[1]
    for i in range(m):
        for row in range(m):
            T[k, row, i] = tools.chosen[k, row, i]
            T_rate[k, row, i] = 0.0
        for row in range(a):
            T[k, row, i] = J[k, tools.rows[row], i]
            T_rate[k, row, i] = J_rate[k, tools.rows[row], i]
        if tools.rotates:
            x, y, z = J[k, 3, i], J[k, 4, i], J[k, 5, i]
            x_rate = J_rate[k, 3, i] - twist[k, 4] * z + twist[k, 5] * y
            y_rate = J_rate[k, 4, i] - twist[k, 5] * x + twist[k, 3] * z
            z_rate = J_rate[k, 5, i] - twist[k, 3] * y + twist[k, 4] * x
            for row in range(3):
                e, f, g = R[k, 0, row], R[k, 1, row], R[k, 2, row]
                T[k, a + row, i] = e * x + f * y + g * z
                T_rate[k, a + row, i] = e * x_rate + f * y_rate + g * z_rate
