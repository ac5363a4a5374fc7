# SPDX-License-Identifier: Apache-2.0
"""Kinds of subtask by name, by import path, and of the user's own."""

import numpy as np
import pytest
from own_kinds import Distance, Unfinished

from noninteract_ros.errors import ScenarioError
from noninteract_ros.scenario import Scenario
from noninteract_ros.subtasks.kinds import registry
from noninteract_ros.subtasks.kinds.registry import kind_named, register_kind

STEP = 1e-6


def scenario(kind: str) -> Scenario:
    """Two point masses on a line, led by a robot's position and by a user's own subtask."""
    gains = {"stiffness": [10.0], "damping": [5.0]}
    return Scenario.from_dict(
        {
            "robots": ["a", "b"],
            "a": {"axes": ["x"], "mass": 1.0, "initial_position": [0.2]},
            "b": {"axes": ["x"], "mass": 2.0, "initial_position": [1.0]},
            "subtasks": ["lead", "apart"],
            "lead": {"kind": "cooperative_position", **gains},
            "apart": {"kind": kind, "scale": 3.0, **gains},
        }
    )


@pytest.fixture
def kinds(monkeypatch):
    monkeypatch.setattr(registry, "SUBTASK_KINDS", dict(registry.SUBTASK_KINDS))


@pytest.mark.parametrize("by_path", [True, False])
def test_a_scenario_can_name_a_user_s_own_kind(by_path, kinds):
    """By its import path, or by a name once registered, with its keys checked like any other."""
    if not by_path:
        register_kind("distance", Distance)
    found = scenario("own_kinds:Distance" if by_path else "distance")
    assert ("apart.scale", 3.0) in [(name, value) for name, _, _, value in found.parameters()]
    team = found.build_team()
    task = found.build_stack(team).subtasks[1]
    q, v = team.q0, np.array([0.3, -0.7])
    ends = [task.evaluate(team.state(q + h * v, v)) for h in (-STEP, STEP)]
    here = task.evaluate(team.state(q, v))
    assert here.x == pytest.approx(3.0 * 0.8**2)
    np.testing.assert_allclose(here.J @ v, (ends[1].x - ends[0].x) / (2 * STEP), atol=1e-8)
    np.testing.assert_allclose(here.J_rate, (ends[1].J - ends[0].J) / (2 * STEP), atol=1e-8)


def test_a_name_can_be_registered_again_but_not_taken(kinds):
    """A class may be registered twice; another class under its name is rejected."""
    register_kind("distance", Distance)
    register_kind("distance", Distance)
    with pytest.raises(ScenarioError, match="kind: found 'relative_pose', allowed: none of"):
        register_kind("relative_pose", Distance)


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (None, ["found nothing", "relative_pose", "my_package.my_module:MyKind"]),
        ("relativ_pose", ["'relativ_pose'", "allowed: relative_pose"]),
        (["posture"], ["['posture']"]),
        ("no_such_module:Kind", ["No module named 'no_such_module'"]),
        ("own_kinds:Missing", ["has no attribute 'Missing'"]),
        (":Distance", ["Empty module name"]),
        ("own_kinds:NOT_A_CLASS", ["a dataclass with a key `kind` and a method `build`"]),
        ("own_kinds:Unfinished", ["a dataclass with a key `kind`"]),
        ("own_kinds:SquaredDistance", ["a dataclass with a key `kind`"]),
    ],
)
def test_kinds_that_are_none_are_refused(kind, words):
    """The error has the key, what was found, and what would be a kind."""
    with pytest.raises(ScenarioError) as caught:
        kind_named("task.kind", kind)
    assert caught.value.key == "task.kind"
    assert all(word in str(caught.value) for word in words)


def test_what_is_no_block_cannot_be_registered(kinds):
    """A class without the key `kind` is refused at once."""
    with pytest.raises(ScenarioError, match="a method `build`"):
        register_kind("unfinished", Unfinished)
