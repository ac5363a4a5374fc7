# SPDX-License-Identifier: Apache-2.0
"""Pairs of bodies that can collide."""

from collections.abc import Sequence
from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin

from noninteract_ros.arrays import Array
from noninteract_ros.team.geometry.bodies import Body
from noninteract_ros.team.geometry.kernels.capsules import CONVEX, PLANE, SEGMENTS, Capsules
from noninteract_ros.team.geometry.kernels.derivatives import sampled
from noninteract_ros.team.geometry.kernels.kinematics import Indices, Tree
from noninteract_ros.team.team import PRISMATIC, Team

SAMPLES = 5000  # random configurations of the joints' whole range
REACH = np.pi  # [m or rad] range of a joint without limits, about the start
APART = 0.1  # [m] distance of capsules in all samples with which a pair stays apart
MEASURED = 100  # samples in which the hulls of a pair are measured: the nearest by capsules
TOUCH = 1e-3  # [m] distance of hulls that counts as none


@dataclass(frozen=True)
class Pairs:
    """Pairs of bodies by index, and excluded pairs.

    Attributes:
        watched: Shape (m, 2).
        kinds: Kind of each, as in `kernels`, shape (m,).
        always: Bodies of one robot that overlap at the start or at all samples.
        never: Bodies of one robot that do not touch at any sample within the limits of its joints.
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
    always, never = _sampled(team, bodies, own.reshape(-1, 2), tree, capsules)
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
        return not (_follows(parents, first, second) or _follows(parents, second, first))
    # An arm's first link turns where its base stands on, or beside, what is around it.
    return not any(
        _rooted(team, a) and b.joint == 0 for a, b in ((first, second), (second, first))
    )


def _follows(parents: Sequence[int], first: Body, second: Body) -> bool:
    """Return True where the second link hangs on the first, or of meshes on the one after it.

    Convex hulls of links with one between them overlap by design where the links never meet.
    """
    parent = parents[second.joint]
    meshes = first.hull is not None and second.hull is not None
    return parent == first.joint or (meshes and parents[parent] == first.joint)


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
    team: Team, bodies: Sequence[Body], pairs: Indices, tree: Tree, capsules: Capsules
) -> tuple[tuple[tuple[int, int], ...], tuple[tuple[int, int], ...]]:
    """Return pairs that overlap at the start or always, and pairs that never do.

    Capsules are larger than the links in them: what comes nearest by capsules is measured by the
    hulls of the links, as far as they have any.
    """
    if not len(pairs):
        return (), ()
    rng, (lower, upper) = np.random.default_rng(0), joint_range(team)
    samples = rng.uniform(lower, upper, (SAMPLES, team.n))
    samples[0] = team.joints_from_configuration(team.q0)
    found = sampled(tree, capsules, pairs, samples)
    always, never = [], []
    for k, (i, j) in enumerate(pairs.tolist()):
        nearest = np.argsort(found[:, k])[:MEASURED]
        if found[:, k].max() < 0.0 or found[0, k] < 0.0:
            always.append((i, j))
        elif found[nearest[0], k] > APART or _hulls_stay_apart(
            team, bodies[i], bodies[j], samples[nearest]
        ):
            never.append((i, j))
    return tuple(always), tuple(never)


def _hulls_stay_apart(team: Team, first: Body, second: Body, samples: Array) -> bool:
    """Return True where the hulls of two links are apart at all joint positions, shape (s, n)."""
    if first.hull is None or second.hull is None:
        return False
    data = team.model.createData()
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    for positions in samples:
        pin.forwardKinematics(team.model, data, team.configuration_from_joints(positions))
        places = [data.oMi[body.joint] for body in (first, second)]
        transforms = [coal.Transform3s(place.rotation, place.translation) for place in places]
        result.clear()
        distance = coal.distance(
            first.hull, transforms[0], second.hull, transforms[1], request, result
        )
        if distance < TOUCH:
            return False
    return True
