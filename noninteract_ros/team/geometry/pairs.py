# SPDX-License-Identifier: Apache-2.0
"""Pairs of bodies that can collide."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.team.geometry.bodies import Body
from noninteract_ros.team.geometry.kernels.capsules import CONVEX, PLANE, SEGMENTS, Capsules
from noninteract_ros.team.geometry.kernels.derivatives import extremes
from noninteract_ros.team.geometry.kernels.kinematics import Indices, Tree
from noninteract_ros.team.team import PRISMATIC, Team

SAMPLES = 10000  # random configurations over the joints' range
REACH = np.pi  # [m or rad] sampled range of an unlimited joint, about the initial position
NEVER = 0.1  # [m] least distance over all samples for an excluded pair


@dataclass(frozen=True)
class Pairs:
    """Pairs of bodies by index, and excluded pairs.

    Attributes:
        watched: Monitored pairs, shape (m, 2).
        kinds: Kind of each pair, as in `kernels.capsules`, shape (m,).
        always: Pairs of one robot that overlap initially or in all samples.
        never: Pairs of one robot that stay apart in all samples.
    """

    watched: Indices
    kinds: Indices
    always: tuple[tuple[int, int], ...]
    never: tuple[tuple[int, int], ...]


def find_pairs(team: Team, bodies: Sequence[Body], tree: Tree, capsules: Capsules) -> Pairs:
    """Return the pairs of bodies on different joints that need monitoring.

    Neighbours are excluded. Pairs of different owners are always monitored. Pairs of one robot are
    sampled over the range of its joints.
    """
    found = [
        (i, j) if not bodies[i].plane else (j, i)
        for i in range(len(bodies))
        for j in range(i + 1, len(bodies))
        if _may_collide(team, bodies[i], bodies[j])
    ]
    own = np.array([p for p in found if bodies[p[0]].owner == bodies[p[1]].owner], dtype=np.int64)
    always, never = _sampled(team, own.reshape(-1, 2), tree, capsules)
    left_out = {*always, *never}
    watched = np.array([p for p in found if p not in left_out], dtype=np.int64).reshape(-1, 2)
    kinds = np.array([_kind(bodies[i], bodies[j]) for i, j in watched], dtype=np.int64)
    return Pairs(watched, kinds, always, never)


def _kind(first: Body, second: Body) -> int:
    if first.convex is not None or second.convex is not None:
        return CONVEX
    return PLANE if second.plane else SEGMENTS


def _may_collide(team: Team, first: Body, second: Body) -> bool:
    if first.joint == second.joint or (first.plane and second.plane):
        return False
    if first.joint in second.touches or second.joint in first.touches:
        return False
    parents = team.model.parents
    if first.owner == second.owner:
        return parents[first.joint] != second.joint and parents[second.joint] != first.joint
    # The first link of an arm rotates within the mounting of its base.
    return not any(
        _rooted(team, a) and b.joint == 0 for a, b in ((first, second), (second, first))
    )


def _rooted(team: Team, body: Body) -> bool:
    """Return True for a body on a world-fixed revolute joint that carries further joints."""
    model, joint = team.model, body.joint
    turns = joint > 0 and model.joints[joint].shortname() not in PRISMATIC
    return turns and model.parents[joint] == 0 and joint in list(model.parents)


def joint_range(team: Team) -> tuple[Array, Array]:
    """Return the lower and upper joint positions, shape (n,) each."""
    start = team.joints_from_configuration(team.q0)
    lower, upper = team.position_limits
    lower = np.where(np.isfinite(lower), lower, start - REACH)
    return lower, np.where(np.isfinite(upper), upper, start + REACH)


def _sampled(
    team: Team, pairs: Indices, tree: Tree, capsules: Capsules
) -> tuple[tuple[tuple[int, int], ...], tuple[tuple[int, int], ...]]:
    """Return the pairs that overlap always or initially, and the pairs that never come close."""
    if not len(pairs):
        return (), ()
    rng, (lower, upper) = np.random.default_rng(0), joint_range(team)
    first = team.joints_from_configuration(team.q0)[None]
    start, _ = extremes(tree, capsules, pairs, np.ascontiguousarray(first))
    least, most = extremes(tree, capsules, pairs, rng.uniform(lower, upper, (SAMPLES, team.n)))
    least, most = np.minimum(least, start), np.maximum(most, start)
    always = [tuple(pair.tolist()) for pair in pairs[(most < 0.0) | (start < 0.0)]]
    never = [tuple(pair.tolist()) for pair in pairs[least > NEVER]]
    return tuple(always), tuple(never)
