# SPDX-License-Identifier: Apache-2.0
"""Distances between bodies, their rows and drifts, against coal and finite differences."""

from collections.abc import Sequence
from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest
from spatial_arms import random_state, spatial_team

from noninteract_ros.arrays import Array
from noninteract_ros.team.geometry.bodies import Body, convex_body, link_bodies
from noninteract_ros.team.geometry.clearance import Clearances, CollisionGeometry
from noninteract_ros.team.geometry.fitting import Capsule, capsule_around
from noninteract_ros.team.geometry.obstacles import BoxObstacle, CapsuleObstacle, PlaneObstacle
from noninteract_ros.team.models.point_mass import PointMass
from noninteract_ros.team.team import Team

STEP = 1e-5


def bodies_of(team: Team, around: Sequence[Body] = ()) -> list[Body]:
    """Links of all robots as capsules, and bodies around them."""
    return [body for robot in team.robots for body in link_bodies(robot, [], team)] + list(around)


def geometry(around: Sequence[Body] = ()) -> CollisionGeometry:
    """Two spatial arms and what is around them."""
    team = spatial_team()
    return CollisionGeometry(team, bodies_of(team, around))


def around() -> list[Body]:
    """A post, a table and a floor."""
    post = CapsuleObstacle(start=(0.4, 0.35, 0.0), end=(0.45, 0.4, 1.0), radius=0.05)
    table = BoxObstacle(size=(0.5, 0.4, 0.1), pose=(0.5, 0.3, 0.1, 0.0, 0.0, 0.2, 0.979796))
    floor = PlaneObstacle(point=(0.0, 0.0, -0.2), normal=(0.1, 0.0, 1.0))
    return [post.body("post"), table.body("table"), floor.body("floor")]


def states(team: Team, count: int = 12) -> list[tuple[Array, Array]]:
    """Configurations near the start, with velocities."""
    rng = np.random.default_rng(5)
    found = [random_state(team, rng) for _ in range(count)]
    return [(state.q, state.v) for state in found]


def by_pair(found: Clearances, values: Array) -> dict[int, Array]:
    """Values of pairs, by the number of the pair."""
    return dict(zip(found.pairs.tolist(), values, strict=True))


def smooth(scene: CollisionGeometry, q: Array, v: Array, ahead: float) -> list[int]:
    """Pairs whose nearest points lie alike on both sides: no edge is passed between."""
    team = scene.team
    sides = [scene.evaluate(team.integrate(q, s * ahead * v), v) for s in (-1.0, 0.0, 1.0)]
    turned = np.abs(sides[2].normals - 2.0 * sides[1].normals + sides[0].normals).max(axis=1)
    shift = np.abs(sides[2].points - 2.0 * sides[1].points + sides[0].points).max(axis=(1, 2))
    straight = np.maximum(turned, shift) < 2e3 * ahead**2 + 1e-9
    return sides[1].pairs[straight & (sides[1].distances > 0.02)].tolist()


@pytest.mark.parametrize("surrounded", [False, True])
def test_rows_are_the_gradients_of_distances(surrounded: bool) -> None:
    """Moving by a tangent vector changes every distance by row and vector."""
    scene = geometry(around() if surrounded else ())
    team = scene.team
    for q, v in states(team):
        pairs = smooth(scene, q, v, STEP)
        assert len(pairs) > 10
        found = scene.evaluate(q, v)
        before, after = (
            scene.evaluate(team.integrate(q, s * STEP * v), v).distances for s in (-1.0, 1.0)
        )
        rates = by_pair(found, (after - before) / (2.0 * STEP))
        rows, given = by_pair(found, found.rows), by_pair(found, found.rates)
        for pair in pairs:
            assert rows[pair] @ v == pytest.approx(given[pair], abs=1e-9)
            assert rates[pair] == pytest.approx(given[pair], abs=2e-5), scene.name(pair)


@pytest.mark.parametrize(("surrounded", "error"), [(False, 1e-5), (True, 0.2)])
def test_drifts_are_the_rates_of_rows_along_a_motion(surrounded: bool, error: float) -> None:
    """Along constant joint velocities the rate of a distance changes by the drift.

    That of convex bodies is a difference over a tick: it knows the curvature's mean alone.
    """
    scene = geometry(around() if surrounded else ())
    team = scene.team
    for q, v in states(team):
        pairs = smooth(scene, q, v, 1e-4)
        found = scene.evaluate(q, v)
        before, after = (
            scene.evaluate(team.integrate(q, s * STEP * v), v).rates for s in (-1.0, 1.0)
        )
        drifts = by_pair(found, (after - before) / (2.0 * STEP))
        given = by_pair(found, found.drifts)
        for pair in pairs:
            assert drifts[pair] == pytest.approx(given[pair], rel=error, abs=error), scene.name(
                pair
            )


def test_capsules_are_as_far_apart_as_coal_finds() -> None:
    """All distances of capsules, nearest points and normals agree with coal's."""
    scene = geometry()
    team = scene.team
    data = team.model.createData()
    for q, v in states(team):
        found = scene.evaluate(q, v)
        pin.forwardKinematics(team.model, data, q)
        for k, pair in enumerate(found.pairs):
            first, second = (scene.bodies[i] for i in scene.pairs.watched[pair])
            result = coal.DistanceResult()
            distance = coal.distance(
                *_capsule(first, data), *_capsule(second, data), coal.DistanceRequest(), result
            )
            assert found.distances[k] == pytest.approx(distance, abs=1e-6)
            between = found.points[k, 1] - found.points[k, 0]
            assert between @ found.normals[k] == pytest.approx(found.distances[k], abs=1e-9)


def _capsule(body: Body, data: pin.Data) -> tuple[coal.Capsule, coal.Transform3s]:
    place, way = data.oMi[body.joint], body.capsule.end - body.capsule.start
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), way).matrix()
    middle = place.act(0.5 * (body.capsule.start + body.capsule.end))
    shape = coal.Capsule(body.capsule.radius, float(np.linalg.norm(way)))
    return shape, coal.Transform3s(place.rotation @ turn, middle)


def test_the_order_of_bodies_does_not_matter() -> None:
    """With bodies listed backwards distances, rows and drifts are the same, normals opposite."""
    team = spatial_team()
    bodies = bodies_of(team, around()[:1])
    forward, backward = CollisionGeometry(team, bodies), CollisionGeometry(team, bodies[::-1])
    for q, v in states(team, 4):
        one, other = forward.evaluate(q, v), backward.evaluate(q, v)
        place = {frozenset(backward.name(p).split(" - ")): k for k, p in enumerate(other.pairs)}
        for k, pair in enumerate(one.pairs):
            twin = place[frozenset(forward.name(pair).split(" - "))]
            assert other.distances[twin] == pytest.approx(one.distances[k], abs=1e-12)
            assert other.rows[twin] == pytest.approx(one.rows[k], abs=1e-9)
            assert other.drifts[twin] == pytest.approx(one.drifts[k], abs=1e-6)
            assert other.normals[twin] == pytest.approx(-one.normals[k], abs=1e-9)


def test_a_reach_leaves_out_what_is_far_and_nothing_else() -> None:
    """Pairs within the reach are those of all pairs that are nearer."""
    scene = geometry(around())
    for q, v in states(scene.team):
        everything = scene.evaluate(q, v)
        near = scene.evaluate(q, v, 0.2)
        assert near.pairs.tolist() == everything.pairs[everything.distances < 0.2].tolist()
        kept = np.isin(everything.pairs, near.pairs)
        assert near.rows == pytest.approx(everything.rows[kept], abs=1e-12)


def test_a_convex_body_of_a_capsule_s_shape_is_as_far_away() -> None:
    """A box in place of a thin capsule gives rows and distances that are nearly the same."""
    team = spatial_team()
    post = CapsuleObstacle(start=(0.4, 0.35, 0.0), end=(0.4, 0.35, 1.0), radius=0.001).body("post")
    size = np.array([0.001, 0.001, 1.0])
    corners = size * np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, 8).T
    box = replace(post, convex=convex_body(corners + np.array([0.4, 0.35, 0.5])))
    scenes = [CollisionGeometry(team, bodies_of(team, [body])) for body in (post, box)]
    for q, v in states(team, 4):
        thin, edged = (scene.evaluate(q, v) for scene in scenes)
        assert edged.distances == pytest.approx(thin.distances, abs=2e-3)


def test_neighbours_and_far_links_are_not_watched() -> None:
    """Links that share a joint are no pair; a link is never paired with itself."""
    scene = geometry()
    parents = scene.team.model.parents
    for i, j in scene.pairs.watched:
        first, second = scene.bodies[i], scene.bodies[j]
        same = first.owner == second.owner
        assert not (same and parents[second.joint] == first.joint)


def test_points_have_no_radius_and_meet_at_zero() -> None:
    """The distance of two point masses is that of their points."""
    masses = [PointMass(1.0, initial_position=(x, 0.0)).build(f"m{x}") for x in (0, 3)]
    team = Team(masses)
    scene = CollisionGeometry(team, bodies_of(team))
    found = scene.evaluate(team.q0, np.zeros(team.n))
    assert found.distances == pytest.approx([3.0])
    assert np.abs(found.rows) == pytest.approx(np.array([[1.0, 0.0, 1.0, 0.0]]))


def test_a_capsule_holds_all_points_it_was_made_for() -> None:
    """No point of a cloud is farther from the segment than the radius."""
    rng = np.random.default_rng(2)
    for _ in range(20):
        points = rng.normal(size=(30, 3)) * rng.uniform(0.05, 1.0, 3) + rng.normal(size=3)
        capsule = capsule_around(points)
        assert _outside(points, capsule) <= 1e-12
        ball = 4.0 / 3.0 * np.pi * np.linalg.norm(points - points.mean(axis=0), axis=1).max() ** 3
        assert capsule.volume <= ball


def _outside(points: Array, capsule: Capsule) -> float:
    way = capsule.end - capsule.start
    share = np.clip((points - capsule.start) @ way / max(way @ way, 1e-12), 0.0, 1.0)
    nearest = capsule.start + share[:, None] * way
    return float((np.linalg.norm(points - nearest, axis=1) - capsule.radius).max())
