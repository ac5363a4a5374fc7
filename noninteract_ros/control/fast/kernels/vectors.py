# SPDX-License-Identifier: Apache-2.0
"""Conversion of vectors between stacked, joint and own coordinates."""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.compiler import inner
from noninteract_ros.control.fast.kernels.array_parts import MixingArrays, Plan, RobotArrays
from noninteract_ros.control.fast.kernels.blocks import product
from noninteract_ros.control.fast.kernels.mixing import mix


@inner
def own_joints(plan: Plan, terms: RobotArrays, v: Array) -> Array:
    """Convert a vector over the joints, shape (n,), to one by robot, shape (N, m, 1)."""
    m = terms.M.shape[1]
    own = np.zeros((len(terms.M), m, 1))
    for i in range(len(v)):
        own[plan.joints[i] // m, plan.joints[i] % m, 0] = v[i]
    return own


@inner
def team_joints(plan: Plan, own: Array) -> Array:
    """Convert a vector by robot to one over the joints; inverse of `own_joints`."""
    m, v = own.shape[1], np.empty(len(plan.joints))
    for i in range(len(v)):
        v[i] = own[plan.joints[i] // m, plan.joints[i] % m, 0]
    return v


@inner
def split(plan: Plan, stacked: Array, c: Array, r: Array, own: Array) -> None:
    """Split stacked columns, shape (n, s), into mean, edges, and chosen joints of own vectors."""
    h, m, s = c.shape[1], own.shape[1], own.shape[2]
    first = h * len(own)
    for j in range(s):
        for i in range(h):
            c[0, i, j] = stacked[plan.order[i], j]
        for i in range(h, first):
            r[i // h - 1, i % h, j] = stacked[plan.order[i], j]
        for k in range(len(own)):
            for i in range(h, m):
                own[k, i, j] = 0.0
        for i in range(len(plan.chosen)):
            own[plan.chosen[i] // m, plan.chosen[i] % m, j] = stacked[plan.order[first + i], j]


@inner
def joined(plan: Plan, c: Array, r: Array, own: Array) -> Array:
    """Join mean, edges and chosen joints to stacked columns, shape (n, s); inverse of `split`."""
    h, m, s = c.shape[1], own.shape[1], own.shape[2]
    first, stacked = h * len(own), np.empty((len(plan.order), s))
    for j in range(s):
        for i in range(h):
            stacked[plan.order[i], j] = c[0, i, j]
        for i in range(h, first):
            stacked[plan.order[i], j] = r[i // h - 1, i % h, j]
        for i in range(len(plan.chosen)):
            stacked[plan.order[first + i], j] = own[plan.chosen[i] // m, plan.chosen[i] % m, j]
    return stacked


@inner
def column(vector: Array) -> Array:
    """Convert a vector to one column, shape (n, 1)."""
    result = np.empty((len(vector), 1))
    for i in range(len(vector)):
        result[i, 0] = vector[i]
    return result


@inner
def first_column(columns: Array) -> Array:
    """Convert one column to a vector; inverse of `column`."""
    result = np.empty(len(columns))
    for i in range(len(columns)):
        result[i] = columns[i, 0]
    return result


@inner
def spread(plan: Plan, stacked: Array) -> Array:
    """Write each subtask into a column of its own, shape (n, subtasks)."""
    columns = np.zeros((len(stacked), len(plan.parts)))
    for i in range(len(stacked)):
        columns[i, plan.owner[i]] = stacked[i]
    return columns


@inner
def picked(plan: Plan, columns: Array) -> Array:
    """Read each subtask from its own column, shape (n,); inverse of `spread`."""
    result = np.empty(len(columns))
    for i in range(len(columns)):
        result[i] = columns[i, plan.owner[i]]
    return result


@inner
def times(blocks: Array, own: Array) -> Array:
    """Multiply each robot's block by the robot's columns."""
    result = np.empty(own.shape)
    for k in range(len(own)):
        product(blocks, k, own, k, result, k)
    return result


@inner
def mixed(plan: Plan, A: MixingArrays, own: Array) -> Array:
    """Return A t, stacked."""
    h, s = A.G.shape[1], own.shape[2]
    c, r = np.empty((1, h, s)), np.empty((len(plan.steps), h, s))
    mix(plan.steps, plan.framed, A, own, c, r)
    return joined(plan, c, r, own)
