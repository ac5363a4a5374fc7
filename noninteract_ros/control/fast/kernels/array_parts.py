# SPDX-License-Identifier: Apache-2.0
"""What the compiled functions pass around: few arrays, whose parts have names only inside them.

A call from Python pays for each array that it hands over, and nothing for their parts.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.compiler import inner

Indices = NDArray[np.intp]
MEAN, EDGES, JOINTS = range(3)


class Plan(NamedTuple):
    """Where the numbers of a structured team are; never changes.

    Robots have h coordinates of their tool and then chosen joints, m in all; who has fewer is
    padded. Sorted coordinates of the subtasks are the mean's h, h of each edge, chosen joints.

    Attributes:
        order: Indices of the sorted coordinates in a stacked vector, shape (n,).
        owner: Subtask of each stacked coordinate, shape (n,).
        chosen: Indices of the chosen joints among N m own coordinates, by subtask and robot,
            shape (P,).
        joints: Indices of the team's joints among N m padded ones, shape (n,).
        steps: A walk over the tree of edges, from the first robot: edge, robot where it is
            reached, the robot behind it, and 1 if that one is the edge's first, otherwise -1;
            shape (N - 1, 4).
        framed: Whether edges are seen from the frame of the mean.
        parts: For each subtask its role, MEAN, EDGES or JOINTS, and which of the h coordinates,
            or of the chosen joints, it has, from and up to; shape (subtasks, 3).
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
        M: Inertia; ones on the diagonal of the padding.
        C: Coriolis matrix.
        T: RobotArrays coordinates per joint velocity.
        T_rate: Its time derivative.
        T_inverse: Its inverse.
        L: Inertia in own coordinates, T^-T M T^-1.
    """

    M: Array
    C: Array
    T: Array
    T_rate: Array
    T_inverse: Array
    L: Array


class MixingArrays(NamedTuple):
    """How tools mix into mean c and edges r, shape (N, h, h) each; edges leave the last one free.

    With the motion t_k of each tool and those t_a, t_b of an edge's robots,

        c = sum over k of G_k t_k,        r_e = K_e (t_a - t_b) + H_e c,        K_e orthogonal

    Attributes:
        G: Weights of the robots in the mean.
        G_rate: Their time derivatives.
        K: Turns differences into the frame that edges are seen from.
        K_rate: Its time derivative.
        H: What the motion of that frame adds; only where plan.framed.
        H_rate: Its time derivative.
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
    """Names the terms of the robots, shape (6, N, m, m)."""
    return RobotArrays(blocks[0], blocks[1], blocks[2], blocks[3], blocks[4], blocks[5])


@inner
def mixing_arrays(mixers: Array) -> MixingArrays:
    """Names the parts of the mixing, shape (7, N, h, h)."""
    return MixingArrays(
        mixers[0], mixers[1], mixers[2], mixers[3], mixers[4], mixers[5], mixers[6]
    )
