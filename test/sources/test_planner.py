# SPDX-License-Identifier: Apache-2.0
"""Formations and the transitions between them."""

import math

import numpy as np
import pytest

from noninteract_ros.errors import ScenarioError
from noninteract_ros.sources.autonomy.planner import Formation, FormationPlanner, PlannerSettings
from noninteract_ros.sources.human.motion import waypoints
from noninteract_ros.subtasks.layout import Layout

WIDE, NARROW, TURNED = (1.0, 1.0), (0.2, 1.0), (0.0, -1.0)


def planner(*formations, dim=2, rate=100.0):
    """Build a planner of formations named a, b, c and so on."""
    named = dict(zip("abcdef", formations, strict=False))
    settings = PlannerSettings(update_rate=rate, formations=tuple(named))
    return FormationPlanner(settings, named, Layout.scalars(dim))


def test_the_papers_formation_is_held():
    """One formation at time 0 is a constant reference from the first instant on."""
    plan = planner(Formation(WIDE))
    for t in (0.0, 0.01, 1e4):
        np.testing.assert_array_equal(plan.sample(t).position, WIDE)
        np.testing.assert_array_equal(plan.sample(t).velocity, [0.0, 0.0])


def test_there_is_no_reference_before_the_first_formation():
    """There is no reference before its time, and next_sample returns that time."""
    plan = planner(Formation(WIDE, time=1.5))
    assert plan.sample(1.49) is None
    assert plan.next_sample(0.0) == 1.5
    assert plan.next_sample(1.5) == 1.51
    assert plan.next_update(0.0) == 0.01
    np.testing.assert_array_equal(plan.sample(1.5).position, WIDE)


@pytest.mark.parametrize("rate", [100.0, 30.0, 7.0])
def test_there_is_a_reference_at_each_next_sample(rate):
    """next_sample and sample agree for starts on and off the grid."""
    for start in [*np.random.default_rng(4).uniform(0.0, 3.0, 50).tolist(), 1 / 3, 0.1 + 0.2]:
        plan = planner(Formation(WIDE, time=start), rate=rate)
        first = plan.next_sample(-1.0)
        assert plan.sample(first) is not None
        assert plan.sample(first - 1.0 / rate) is None


def test_transitions_are_minimum_jerk_between_rests():
    """Each transition is a minimum-jerk move over its duration; formations hold between."""
    plan = planner(
        Formation(WIDE),
        Formation(NARROW, time=2.0, duration=3.0),
        Formation(TURNED, time=6.0, duration=1.0),
    )
    expected = waypoints([0, 2, 5, 6, 7], [WIDE, WIDE, NARROW, NARROW, TURNED])
    for t in np.linspace(0.0, 8.0, 161):
        now, then = plan.sample(t), expected(t)
        np.testing.assert_allclose(now.position, then.position, atol=1e-15)
        np.testing.assert_allclose(now.velocity, then.velocity, atol=1e-15)
        np.testing.assert_allclose(now.acceleration, then.acceleration, atol=1e-14)


def test_a_transition_may_start_where_the_last_one_ends():
    """Adjacent transitions do not overlap."""
    plan = planner(Formation(WIDE), Formation(NARROW, 0.0, 1.0), Formation(TURNED, 1.0, 2.0))
    np.testing.assert_array_equal(plan.sample(1.0).position, NARROW)
    np.testing.assert_array_equal(plan.sample(math.pi).position, TURNED)


@pytest.mark.parametrize(
    ("formations", "message"),
    [
        ([], "planner.formations: found an empty list, allowed: 1 or more names"),
        ([Formation((1.0,))], "planner.a.value: found [1.0], allowed: 2 numbers"),
        ([Formation(WIDE, 0.0, 1.0)], "planner.a.duration: found 1.0, allowed: 0 for the first"),
        ([Formation(WIDE), Formation(NARROW, 1.0)], "planner.b.duration: found 0.0, allowed: > 0"),
        (
            [Formation(WIDE), Formation(NARROW, 1.0, 2.0), Formation(WIDE, 2.5, 1.0)],
            "planner.c.time: found 2.5, allowed: >= 3, when the formation before it is reached",
        ),
        ([Formation(WIDE, 2.0), Formation(NARROW, 1.0, 1.0)], "planner.b.time: found 1.0"),
    ],
)
def test_invalid_formations_are_rejected_by_key(formations, message):
    """The error names the formation's key, the value found and the allowed values."""
    with pytest.raises(ScenarioError) as caught:
        planner(*formations)
    assert message in str(caught.value)


def test_a_listed_formation_needs_a_block():
    """The error names the key of the missing block."""
    with pytest.raises(ScenarioError, match=r"planner\.pair: found nothing"):
        FormationPlanner(PlannerSettings(formations=("pair",)), {}, Layout.scalars(2))


def test_a_name_listed_twice_is_rejected():
    """A formation has one time, so it cannot be listed twice."""
    named = {"a": Formation(WIDE), "b": Formation(NARROW, 1.0, 1.0)}
    with pytest.raises(ScenarioError, match=r"planner\.b\.time"):
        FormationPlanner(PlannerSettings(formations=("a", "b", "b")), named, Layout.scalars(2))
