# SPDX-License-Identifier: Apache-2.0
"""Values of the subtasks, and the mixing of the tools' motions."""

from typing import NamedTuple

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.compiler import FIRST, compiled, inner
from noninteract_ros.control.fast.kernels import rotations
from noninteract_ros.control.fast.kernels.array_parts import (
    Indices,
    MixingArrays,
    Plan,
    mixing_arrays,
)
from noninteract_ros.control.fast.kernels.blocks import invert
from noninteract_ros.control.fast.kernels.mean_rotation import mean_rotation, put_turning
from noninteract_ros.control.fast.kernels.mixing import unmix
from noninteract_ros.control.fast.kernels.robots import Poses, Tools


class Means(NamedTuple):
    """Constants of mean and edges.

    Attributes:
        weights: Weight of each robot in the mean, shape (N,).
        order: Indices of the values of mean and edges, sorted as in `Plan`.
        framed_points: True if the edges' positions are expressed in the frame of the mean.
        framed_rotations: True if the edges' rotations are expressed in the frame of the mean.
    """

    weights: Array
    order: Indices
    framed_points: bool
    framed_rotations: bool


class MeanFrame(NamedTuple):
    """Frame of the mean.

    Attributes:
        q: Quaternion.
        R: Rotation matrix, shape (1, 3, 3).
        omega: Angular velocity.
    """

    q: rotations.Quaternion
    R: Array
    omega: rotations.Vector


@compiled
def mixing_terms(
    plan: Plan,
    tools: Tools,
    means: Means,
    poses: Poses,
    mixers: Array,
    G_inverse: Array,
    x: Array,
) -> None:
    """Compute the mixing, and the values of all subtasks except joints.

    Args:
        plan: Index tables.
        tools: Constants of the tools.
        means: Constants of mean and edges.
        poses: Poses of the tools.
        mixers: Output: mixing, zeros on input, shape (7, N, h, h).
        G_inverse: Output: inverse of the sum of all G_k, shape (1, h, h).
        x: Output: values of all subtasks, shape (size,).
    """
    A, a, N = mixing_arrays(mixers), len(tools.rows), len(poses.positions)
    values, phis = np.zeros((N, a + 4)), np.empty((N, 3))
    for k in range(N):
        for i in range(a):
            A.G[k, i, i] = means.weights[k]
            values[0, i] += means.weights[k] * poses.positions[k, tools.rows[i]]
    q, R, omega = (0.0, 0.0, 0.0, 1.0), np.empty((1, 3, 3)), (0.0, 0.0, 0.0)
    if tools.rotates:
        q = mean_rotation(means.weights, poses.rotations, phis)
        omega = put_turning(A, a, means.weights, phis, poses)
        rotations.put_quaternion(rotations.positive(q), values, FIRST, a)
    rotations.put_matrix(q, R, FIRST)
    frame = MeanFrame(q, R, omega)
    for step in range(N - 1):
        first, second = plan.steps[step, 1], plan.steps[step, 2]
        if plan.steps[step, 3] > 0:
            first, second = second, first
        _put_edge(tools, means, poses, frame, A, plan.steps[step, 0], first, second, values)
    width = a + 4 if tools.rotates else a
    for i in range(len(means.order)):
        x[means.order[i]] = values[i // width, i % width]
    _put_inverse(plan, A, G_inverse)


@inner
def _put_inverse(plan: Plan, A: MixingArrays, G_inverse: Array) -> None:
    """Write the inverse of the sum of G, and B."""
    h = G_inverse.shape[1]
    total, work, one = np.zeros((1, h, h)), np.empty((1, h, h)), np.zeros((1, h, h))
    for i in range(h):
        one[0, i, i] = 1.0
        for j in range(h):
            for k in range(len(A.G)):
                total[0, i, j] += A.G[k, i, j]
    invert(total, FIRST, work, G_inverse, FIRST)
    none = np.zeros((len(plan.steps), h, h))
    unmix(plan.steps, plan.framed, A, G_inverse, one, none, A.B)


@inner
def _axis(frame: MeanFrame, framed: bool, i: int) -> tuple[rotations.Vector, rotations.Vector]:
    """Return axis i of the reference frame, the mean's or the world's, and its time derivative."""
    if framed:
        axis = frame.R[0, 0, i], frame.R[0, 1, i], frame.R[0, 2, i]
        return axis, rotations.cross(frame.omega, axis)
    axis = 1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0
    return axis, (0.0, 0.0, 0.0)


@inner
def _put_points(
    frame: MeanFrame,
    framed: bool,
    A: MixingArrays,
    edge: int,
    d: rotations.Vector,
    d_rate: rotations.Vector,
) -> None:
    """Write K and H of a difference d in the frame: R_c' d, with rate R_c' (d' + d x omega_c)."""
    for i in range(3):
        axis, axis_rate = _axis(frame, framed, i)
        arm, arm_rate = rotations.cross(axis, d), rotations.cross(axis, d_rate)
        turned = rotations.cross(axis_rate, d)
        for j in range(3):
            A.K[edge, i, j], A.K_rate[edge, i, j] = axis[j], axis_rate[j]
            A.H[edge, i, 3 + j], A.H_rate[edge, i, 3 + j] = arm[j], arm_rate[j] + turned[j]


@inner
def _put_rotations(
    poses: Poses,
    frame: MeanFrame,
    framed: bool,
    A: MixingArrays,
    edge: int,
    first: int,
    second: int,
) -> None:
    """Write K and H of E = R_a R_b', with rate R_a (omega_a - omega_b) in axes of the tools.

    In the frame, the rate is R_c' (omega_E - (1 - E) omega_c), omega_E = omega_a - E omega_b in
    world axes.
    """
    R, a = poses.rotations, A.K.shape[1] - 3
    omega = rotations.vector_at(poses.twists, first, rotations.ANGULAR)
    behind = rotations.vector_at(poses.twists, second, rotations.ANGULAR)
    turned = rotations.times(R, first, rotations.transposed_times(R, second, behind))
    omega_E = rotations.combined(-1.0, turned, omega)
    for i in range(3):
        axis, axis_rate = _axis(frame, framed, i)
        moved = rotations.combined(1.0, axis_rate, rotations.cross(axis, omega))
        row = rotations.transposed_times(R, first, axis)
        row_rate = rotations.transposed_times(R, first, moved)
        for j in range(3):
            A.K[edge, a + i, a + j], A.K_rate[edge, a + i, a + j] = row[j], row_rate[j]
        if framed:
            pushed = rotations.combined(1.0, axis_rate, rotations.cross(axis, omega_E))
            back = rotations.times(R, second, row)
            back_rate = rotations.transposed_times(R, first, pushed)
            back_rate = rotations.times(R, second, back_rate)
            for j in range(3):
                A.H[edge, a + i, a + j] = back[j] - axis[j]
                A.H_rate[edge, a + i, a + j] = back_rate[j] - axis_rate[j]


@inner
def _put_edge(
    tools: Tools,
    means: Means,
    poses: Poses,
    frame: MeanFrame,
    A: MixingArrays,
    edge: int,
    first: int,
    second: int,
    values: Array,
) -> None:
    """Write the values of an edge, and its K and H with their rates."""
    a = len(tools.rows)
    p, q = rotations.vector_at(poses.positions, first, FIRST), poses.positions
    d = rotations.combined(-1.0, rotations.vector_at(q, second, FIRST), p)
    speed = rotations.vector_at(poses.twists, first, FIRST)
    d_rate = rotations.combined(-1.0, rotations.vector_at(poses.twists, second, FIRST), speed)
    for i in range(a):
        A.K[edge, i, i] = 1.0
        values[1 + edge, i] = d[tools.rows[i]]
    if means.framed_points:
        _put_points(frame, means.framed_points, A, edge, d, d_rate)
        in_frame = rotations.transposed_times(frame.R, FIRST, d)
        for i in range(3):
            values[1 + edge, i] = in_frame[i]
    if tools.rotates:
        framed = means.framed_rotations
        _put_rotations(poses, frame, framed, A, edge, first, second)
        behind = rotations.inverse(rotations.of_matrix(poses.rotations, second))
        E = rotations.product(rotations.of_matrix(poses.rotations, first), behind)
        if framed:
            E = rotations.product(rotations.inverse(frame.q), rotations.product(E, frame.q))
        rotations.put_quaternion(rotations.positive(E), values, 1 + edge, a)
