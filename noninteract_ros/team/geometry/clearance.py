# SPDX-License-Identifier: Apache-2.0
"""Distances between all bodies of a team and its surroundings, with their derivatives."""

from collections.abc import Sequence
from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin

from noninteract_ros.arrays import Array
from noninteract_ros.team.geometry.bodies import Body
from noninteract_ros.team.geometry.kernels.capsules import CONVEX, Capsules
from noninteract_ros.team.geometry.kernels.derivatives import Near, contact_terms, survey
from noninteract_ros.team.geometry.kernels.kinematics import Indices, Motion, Tree
from noninteract_ros.team.geometry.pairs import find_pairs
from noninteract_ros.team.team import PRISMATIC, Team

AHEAD = 1e-3  # [s] step of finite differences for rates between convex bodies


@dataclass(frozen=True, slots=True)
class Clearances:
    """Pairs of close bodies; ddot d = row a + drift for a joint acceleration a.

    Attributes:
        pairs: Indices of the pairs, shape (k,).
        distances: Distances, shape (k,) [m]; negative for overlapping capsules.
        points: Nearest points of both bodies in the world, shape (k, 2, 3) [m].
        normals: Directions from the first to the second body, shape (k, 3).
        rows: Jacobian of the distances, shape (k, n).
        rates: Rates of the distances, rows v, shape (k,) [m/s].
        drifts: d(rows)/dt v, shape (k,) [m/s^2].
        least: Smallest distance of all pairs [m], a lower bound beyond the reach; inf without
            pairs.
    """

    pairs: Indices
    distances: Array
    points: Array
    normals: Array
    rows: Array
    rates: Array
    drifts: Array
    least: float


class CollisionGeometry:
    """Bodies of a team and its surroundings, and the pairs of them that can collide.

    Args:
        team: The robots.
        bodies: Links, held objects and surroundings.

    Attributes:
        bodies: The bodies.
        pairs: Monitored pairs, and excluded ones.
    """

    def __init__(self, team: Team, bodies: Sequence[Body]) -> None:
        self.team, self.bodies = team, tuple(bodies)
        self._tree = _tree(team)
        self._capsules = _capsules(self.bodies)
        self.pairs = find_pairs(team, self.bodies, self._tree, self._capsules)
        self._convex = np.flatnonzero(self.pairs.kinds == CONVEX)
        self._shapes = [_coal_shape(body) for body in self.bodies] if len(self._convex) else []
        self._request, self._result = coal.DistanceRequest(), coal.DistanceResult()

    def name(self, pair: int) -> str:
        """Return the names of the two bodies of a pair."""
        first, second = self.pairs.watched[pair]
        return f"{self.bodies[first].name} - {self.bodies[second].name}"

    def evaluate(
        self, q: Array, v: Array, reach: float = np.inf, horizon: float = 0.0
    ) -> Clearances:
        """Clearances of the pairs that are nearer than a reach [m].

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (n,).
            reach: Distance from which on a pair is left out [m].
            horizon: Time in which bodies may come closer, which the reach grows by [s].
        """
        positions = np.ascontiguousarray(self.team.joints_from_configuration(q))
        watched, kinds = self.pairs.watched, self.pairs.kinds
        motion, found, chosen, near, reach = survey(
            self._tree, self._capsules, watched, kinds, positions, v, reach, horizon
        )
        if len(self._convex):
            # Distances of convex bodies are those of the capsules around them so far.
            chosen, near = self._refined(motion, found, chosen, near, reach)
        least = float(found.min()) if len(found) else np.inf
        return Clearances(chosen, found[chosen], *near, least)

    def _refined(
        self, motion: Motion, found: Array, chosen: Indices, near: Near, reach: float
    ) -> tuple[Indices, Near]:
        """Compute distances and terms of convex bodies; return the remaining pairs and terms."""
        convex = np.flatnonzero(self.pairs.kinds[chosen] == CONVEX)
        now = np.empty((len(convex), 3, 3))
        for k, place in enumerate(convex):
            found[chosen[place]] = self._between(motion, chosen[place], 0.0, now[k])
        left = found[chosen] < reach
        kept = left[convex]
        now, later = now[kept], np.empty((int(kept.sum()), 3, 3))
        chosen, near = chosen[left], Near(*(values[left] for values in near))
        convex = np.flatnonzero(self.pairs.kinds[chosen] == CONVEX)
        for k, place in enumerate(convex):
            self._between(motion, chosen[place], AHEAD, later[k])
        if len(convex):
            part = Near(*(values[convex] for values in near))
            joints = self._capsules.joints[self.pairs.watched[chosen[convex]]]
            contact_terms(self._tree, motion, joints, now, later, AHEAD, part)
            for values, filled in zip(near, part, strict=True):
                values[convex] = filled
        return chosen, near

    def _between(self, motion: Motion, pair: int, ahead: float, out: Array) -> float:
        """Return a convex pair's distance `ahead` [s] from now; write normal and points."""
        i, j = self.pairs.watched[pair]
        result = self._result
        result.clear()
        distance = coal.distance(
            self._shapes[i][0],
            self._transform(motion, i, ahead),
            self._shapes[j][0],
            self._transform(motion, j, ahead),
            self._request,
            result,
        )
        out[0], out[1], out[2] = (
            result.normal,
            result.getNearestPoint1(),
            result.getNearestPoint2(),
        )
        return float(distance)

    def _transform(self, motion: Motion, body: int, ahead: float) -> coal.Transform3s:
        joint, placement = self.bodies[body].joint, self._shapes[body][1]
        rotation, origin = motion.rotations[joint], motion.origins[joint]
        if ahead and joint:
            turn = ahead * (motion.angular[joint] + 0.5 * ahead * motion.angular_bias[joint])
            rotation = pin.exp3(turn) @ rotation
            travelled = motion.linear[joint] + 0.5 * ahead * motion.linear_bias[joint]
            origin = origin + ahead * travelled
        if placement is None:
            return coal.Transform3s(rotation, origin)
        turned = rotation @ placement.rotation
        return coal.Transform3s(turned, origin + rotation @ placement.translation)


def _tree(team: Team) -> Tree:
    """Return the team's joints as arrays."""
    model = team.model
    data, count = model.createData(), model.njoints
    pin.computeJointJacobians(model, data, team.q0)
    axes, columns = np.zeros((count, 3)), np.full(count, -1, dtype=np.int64)
    sliding = np.zeros(count, dtype=bool)
    for j in range(1, count):
        columns[j] = model.joints[j].idx_v
        sliding[j] = model.joints[j].shortname() in PRISMATIC
        column = pin.getJointJacobian(model, data, j, pin.LOCAL)[:, columns[j]]
        axes[j] = column[:3] if sliding[j] else column[3:]
    placements = list(model.jointPlacements)
    return Tree(
        np.array(model.parents, dtype=np.int64),
        np.array([placement.rotation for placement in placements]),
        np.array([placement.translation for placement in placements]),
        axes,
        sliding,
        columns,
    )


def _capsules(bodies: Sequence[Body]) -> Capsules:
    planes = [body.plane for body in bodies]
    starts = np.array([body.capsule.start for body in bodies]).reshape(-1, 3)
    ends = np.array([body.capsule.end for body in bodies]).reshape(-1, 3)
    ends[planes] -= starts[planes]
    radii = np.array([-1.0 if body.plane else body.capsule.radius for body in bodies])
    return Capsules(np.array([b.joint for b in bodies], dtype=np.int64), starts, ends, radii)


def _coal_shape(body: Body) -> tuple[object, pin.SE3 | None]:
    """Return the coal geometry of a body and its placement in the joint's frame, or None."""
    if body.convex is not None:
        return body.convex, None
    capsule = body.capsule
    if body.plane:
        normal = capsule.end - capsule.start
        return coal.Halfspace(normal, float(normal @ capsule.start)), None
    way = capsule.end - capsule.start
    length = float(np.linalg.norm(way))
    turn = np.eye(3)
    if length > 0.0:
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), way).matrix()
    middle = pin.SE3(turn, 0.5 * (capsule.start + capsule.end))
    if length < 1e-9:
        return coal.Sphere(max(capsule.radius, 1e-6)), middle
    return coal.Capsule(max(capsule.radius, 1e-6), length), middle
