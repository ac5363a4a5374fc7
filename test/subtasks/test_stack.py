# SPDX-License-Identifier: Apache-2.0
"""The stacked subtasks and the paper's assumptions 1 to 3."""

import numpy as np
import pytest

from noninteract_ros.errors import SubtaskError
from noninteract_ros.subtasks.kinds.cooperative_position import CooperativePosition
from noninteract_ros.subtasks.kinds.relative_position import RelativePosition
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.subtasks.subtask import Subtask
from noninteract_ros.team.models.point_mass import PointMass
from noninteract_ros.team.team import Team


def team(count: int, axes: tuple[str, ...] = ("x", "y")) -> Team:
    return Team([PointMass(1.0 + i, axes=axes).build(f"r{i + 1}") for i in range(count)])


def cooperative(robots: Team, name: str = "cooperative", **keys) -> Subtask:
    return CooperativePosition("cooperative_position", **keys).build(name, robots)


def relative(robots: Team, name: str = "relative", **keys) -> Subtask:
    return RelativePosition("relative_position", **keys).build(name, robots)


@pytest.mark.parametrize("count", [2, 3, 5])
def test_chain_and_star_meet_the_assumptions(count):
    """Mean and N - 1 edges of a chain or a star make a square Jacobian of full rank."""
    robots = team(count)
    star = [name for other in robots.names[1:] for name in (robots.names[0], other)]
    for edges in ((), tuple(star)):
        stack = SubtaskStack(robots, [cooperative(robots), relative(robots, edges=edges)])
        J = stack.evaluate(robots.state(robots.q0, np.zeros(robots.n))).J
        assert J.shape == (2 * count, 2 * count)
        assert np.linalg.matrix_rank(J) == 2 * count


def test_values_stand_one_above_the_other_in_order():
    """The stack has each subtask's rows where its slice says."""
    robots = team(3)
    parts = [relative(robots), cooperative(robots)]
    stack = SubtaskStack(robots, parts)
    assert stack.names == ("relative", "cooperative")
    assert stack.slices == (slice(0, 4), slice(4, 6))
    rng = np.random.default_rng(0)
    state = robots.state(rng.normal(size=6), rng.normal(size=6))
    whole = stack.evaluate(state)
    for part, own in zip(parts, stack.slices, strict=True):
        single = part.evaluate(state)
        np.testing.assert_array_equal(whole.x[own], single.x)
        np.testing.assert_array_equal(whole.J[own], single.J)
        np.testing.assert_array_equal(whole.J_rate[own], single.J_rate)


def test_too_few_coordinates_are_counted():
    """Internal dynamics, assumptions 1 and 2: the error adds up the dimensions."""
    robots = team(3)
    with pytest.raises(SubtaskError) as caught:
        SubtaskStack(robots, [cooperative(robots), relative(robots, edges=("r1", "r2"))])
    text = str(caught.value)
    assert "assumption 1 and 2 (internal dynamics)" in text
    assert "2 (cooperative) + 2 (relative) = 4 coordinates, the team has 6" in text


def test_too_many_coordinates_are_counted():
    """Assumption 2: the error adds up the dimensions of goals that are too many."""
    robots = team(2)
    parts = [cooperative(robots), relative(robots), relative(robots, "again")]
    with pytest.raises(SubtaskError) as caught:
        SubtaskStack(robots, parts)
    assert "assumption 2 (too many goals)" in str(caught.value)
    assert "2 (cooperative) + 2 (relative) + 2 (again) = 6 coordinates, the team has 4" in str(
        caught.value
    )


def test_edges_in_a_loop_are_found_by_rank():
    """Assumption 3: three edges in a loop leave the fourth robot free, which the rank shows."""
    robots = team(4)
    loop = relative(robots, edges=("r1", "r2", "r2", "r3", "r3", "r1"))
    with pytest.raises(SubtaskError) as caught:
        SubtaskStack(robots, [cooperative(robots), loop])
    text = str(caught.value)
    assert "assumption 3" in text
    assert "rank 6 of 8" in text
    assert "cooperative 2 of 2" in text
    assert "relative 4 of 6" in text


def test_an_axis_that_no_robot_has_is_found_by_rank():
    """Leading robots of the plane along z is no goal that they can reach."""
    robots = team(2)
    with pytest.raises(SubtaskError, match=r"rank 3 of 4 .*cooperative 1 of 2, relative 2 of 2"):
        SubtaskStack(robots, [cooperative(robots, axes=("x", "z")), relative(robots)])


def test_weights_on_one_robot_are_enough():
    """A leader's position and its distances to the others are independent goals."""
    robots = team(3)
    SubtaskStack(robots, [cooperative(robots, weights=(0.0, 1.0, 0.0)), relative(robots)])


def test_a_name_twice_is_refused():
    """Two subtasks of one name could not be told apart."""
    robots = team(2)
    with pytest.raises(SubtaskError, match=r"\['same', 'same'\]"):
        SubtaskStack(robots, [cooperative(robots, "same"), relative(robots, "same")])
