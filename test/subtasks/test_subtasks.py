# SPDX-License-Identifier: Apache-2.0
"""Cooperative and relative position: values, differentials and what they refuse."""

import numpy as np
import pytest
from planar_arms import arm

from noninteract_ros.errors import ScenarioError
from noninteract_ros.subtasks.kinds.cooperative_position import CooperativePosition
from noninteract_ros.subtasks.kinds.relative_position import RelativePosition
from noninteract_ros.team.models.point_mass import PointMass
from noninteract_ros.team.team import Team

STEP = 1e-6


def cooperative(**keys) -> CooperativePosition:
    return CooperativePosition("cooperative_position", **keys)


def relative(**keys) -> RelativePosition:
    return RelativePosition("relative_position", **keys)


def masses(count: int = 3, axes: tuple[str, ...] = ("x", "y")) -> Team:
    return Team([PointMass(1.0 + i, axes=axes).build(f"robot_{i + 1}") for i in range(count)])


def arms() -> Team:
    return Team(
        [
            arm("robot_1", 1.0, 0.7, 0.5, axes="zyz", start=(0.1, 0.2, 0.3)),
            arm("robot_2", 3.0, 2.0, 1.0, axes="yzy", start=(0.4, -0.8, 1.0)),
            arm("robot_3", 2.0, 1.0, axes="zz"),
        ]
    )


BLOCKS = [
    pytest.param(cooperative(), id="mean"),
    pytest.param(cooperative(weights=(3.0, 0.0, 1.0)), id="weighted mean"),
    pytest.param(cooperative(axes=("z", "x")), id="chosen axes"),
    pytest.param(relative(), id="chain"),
    pytest.param(relative(edges=("robot_2", "robot_1", "robot_2", "robot_3")), id="star"),
]


@pytest.mark.parametrize("block", BLOCKS)
@pytest.mark.parametrize("build", [masses, arms])
def test_jacobian_and_rate_are_derivatives(build, block):
    """J v is the rate of the value along the motion, and J_rate that of J (6)."""
    team = build()
    subtask = block.build("task", team)
    rng = np.random.default_rng(1)
    q, v = team.integrate(team.q0, rng.normal(size=team.n)), rng.normal(size=team.n)
    here = subtask.evaluate(team.state(q, v))
    after = subtask.evaluate(team.state(team.integrate(q, STEP * v), v))
    before = subtask.evaluate(team.state(team.integrate(q, -STEP * v), v))
    np.testing.assert_allclose(here.J @ v, (after.x - before.x) / (2 * STEP), atol=1e-8)
    np.testing.assert_allclose(here.J_rate, (after.J - before.J) / (2 * STEP), atol=1e-8)
    assert here.x.shape == (subtask.dim,)
    assert here.J.shape == (subtask.dim, team.n)


def value(block, team: Team, q) -> np.ndarray:
    return block.build("task", team).evaluate(team.state(np.array(q), np.zeros(team.n))).x


def test_cooperative_position_is_the_weighted_mean():
    """Weights are normalised; without them every robot counts alike (34)."""
    q = [0.0, 0.0, 4.0, 0.0, 0.0, 8.0]
    np.testing.assert_allclose(value(cooperative(), masses(), q), [4 / 3, 8 / 3], rtol=1e-15)
    weighted = cooperative(weights=(1.0, 5.0, 2.0))
    np.testing.assert_allclose(value(weighted, masses(), q), [2.5, 2.0], rtol=1e-15)


def test_relative_position_is_first_minus_second_of_each_edge():
    """Edges are listed one after the other, each with all axes; a chain is the default (34)."""
    q = [1.0, 2.0, 10.0, 20.0, 100.0, 200.0]
    chain = value(relative(), masses(), q)
    np.testing.assert_allclose(chain, [-9.0, -18.0, -90.0, -180.0], rtol=1e-14)
    star = relative(edges=("robot_3", "robot_1", "robot_2", "robot_1"))
    np.testing.assert_allclose(value(star, masses(), q), [99.0, 198.0, 9.0, 18.0], rtol=1e-14)


def test_axes_may_come_in_any_order():
    """Chosen axes keep the order in which they are named."""
    team = masses(2, ("x", "y", "z"))
    q = [1.0, 2.0, 3.0, 1.0, 2.0, 3.0]
    np.testing.assert_allclose(value(cooperative(axes=("z", "x")), team, q), [3.0, 1.0])


def test_default_axes_are_those_that_all_robots_share():
    """Robots in x-y and y-z are led along y."""
    robots = [PointMass(1.0).build("a"), PointMass(1.0, axes=("y", "z")).build("b")]
    assert cooperative().build("task", Team(robots)).axes == ("y",)


def test_elements_name_what_the_coordinates_belong_to():
    """A cooperative subtask is one element of its own name, a relative one has an edge each."""
    assert cooperative().build("lead", masses()).elements == ("lead",)
    edges = relative().build("shape", masses()).elements
    assert edges == ("robot_1-robot_2", "robot_2-robot_3")


@pytest.mark.parametrize(
    ("block", "key", "words"),
    [
        (cooperative(weights=(1.0, 1.0)), "weights", ["3 numbers", "[1.0, 1.0]", "robot_2"]),
        (cooperative(weights=(0.0, 0.0, 0.0)), "weights", ["positive sum"]),
        (cooperative(axes=("x", "x")), "axes", ["['x', 'x']", "['x', 'y']"]),
        (relative(edges=("robot_1",)), "edges", ["['robot_1']", "pairs of different robots"]),
        (relative(edges=("robot_1", "robot_1")), "edges", ["pairs of different robots"]),
        (relative(edges=("robot_1", "robot_9")), "edges", ["robot_9", "robot_3"]),
        (relative(axes=("z", "z")), "axes", ["different ones"]),
    ],
)
def test_what_does_not_fit_the_team_is_refused(block, key, words):
    """The error has the full key, what was found and what the team allows."""
    with pytest.raises(ScenarioError) as caught:
        block.build("task", masses())
    assert caught.value.key == f"task.{key}"
    assert all(word in str(caught.value) for word in words)


def test_robots_without_a_common_axis_are_refused():
    """One robot along x and one along y share no coordinate to lead."""
    robots = [PointMass(1.0, axes=(axis,)).build(axis) for axis in ("x", "y")]
    with pytest.raises(
        ScenarioError, match=r"task\.axes: found \[\].*common to all robots are \[\]"
    ):
        relative().build("task", Team(robots))
