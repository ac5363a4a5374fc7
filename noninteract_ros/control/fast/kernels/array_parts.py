# SPDX-License-Identifier: Apache-2.0
"""Arguments of the compiled functions: few arrays, with named parts inside the functions.

A call from Python has a cost per array that is passed, and none for its parts.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.compiler import inner

Indices = NDArray[np.intp]
MEAN, EDGES, JOINTS = range(3)


class Plan(NamedTuple):
    """Index tables of a structured team; constant.

    Each robot has h tool coordinates followed by its chosen joints, m in all; robots with fewer
    coordinates are padded. These m coordinates are called the robot's own. The sorted coordinates
    of the subtasks are the h of the mean, h of each edge, and the chosen joints.

    Attributes:
        order: Indices of the sorted coordinates in a stacked vector, shape (n,).
        owner: Subtask of each stacked coordinate, shape (n,).
        chosen: Indices of the chosen joints among N m own coordinates, by subtask and robot,
            shape (P,).
        joints: Indices of the team's joints among N m padded ones, shape (n,).
        steps: Traversal of the tree of edges from the first robot; for each step the edge, the
            robot reached before, the robot reached by it, and 1 if the latter is the edge's
            first robot, otherwise -1; shape (N - 1, 4).
        framed: True if edges are expressed in the frame of the mean.
        parts: For each subtask its role, MEAN, EDGES or JOINTS, and the range of the h
            coordinates, or of the chosen joints, that it has; shape (subtasks, 3).
    """

    order: Indices
    owner: Indices
    chosen: Indices
    joints: Indices
    steps: Indices
    framed: bool
    parts: Indices


class RobotArrays(NamedTuple):
    """Terms of the robots, shape (N, m, m) each.

    Attributes:
        M: Inertia matrix; ones on the diagonal of the padding.
        C: Coriolis matrix.
        T: Own velocities per joint velocity.
        T_rate: Time derivative of T.
        T_inverse: Inverse of T.
        L: Inertia in own coordinates, T^-T M T^-1.
    """

    M: Array
    C: Array
    T: Array
    T_rate: Array
    T_inverse: Array
    L: Array


class MixingArrays(NamedTuple):
    """Map of the tools' motions to mean c and edges r, shape (N, h, h) each; edges use N - 1.

    With the motion t_k of each tool and those t_a, t_b of an edge's robots,

        c = sum over k of G_k t_k,        r_e = K_e (t_a - t_b) + H_e c,        K_e orthogonal

    Attributes:
        G: Weights of the robots in the mean.
        G_rate: Time derivative of G.
        K: Rotation of differences into the frame of the edges.
        K_rate: Time derivative of K.
        H: Contribution of the motion of that frame; used only if plan.framed.
        H_rate: Time derivative of H.
        B: Motion of each tool per motion of the mean: columns of A^-1.
    """

    G: Array
    G_rate: Array
    K: Array
    K_rate: Array
    H: Array
    H_rate: Array
    B: Array


ROBOT_ARRAYS, MIXING_ARRAYS = len(RobotArrays._fields), len(MixingArrays._fields)


@inner
def robot_arrays(blocks: Array) -> RobotArrays:
    """Return the terms of the robots, shape (6, N, m, m), by name."""
    return RobotArrays(blocks[0], blocks[1], blocks[2], blocks[3], blocks[4], blocks[5])


@inner
def mixing_arrays(mixers: Array) -> MixingArrays:
    """Return the parts of the mixing, shape (7, N, h, h), by name."""
    return MixingArrays(
        mixers[0], mixers[1], mixers[2], mixers[3], mixers[4], mixers[5], mixers[6]
    )
