# SPDX-License-Identifier: Apache-2.0
"""Topics of robots of one's own: what fits, and what is refused in words."""

from typing import Any

import pytest
from repository import ROOT

from noninteract_ros.errors import ScenarioError
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import read_parameters

OWN = ROOT / "config" / "own_robots.yaml"


def scenario(**changes: Any) -> Scenario:
    """The scenario own_robots with changes of its left robot; None removes a key."""
    values = read_parameters(OWN)
    left = values["left"] | changes
    values["left"] = {key: value for key, value in left.items() if value is not None}
    return Scenario.from_dict(values)


def test_an_effort_controller_has_an_order_of_its_own() -> None:
    """Numbers on its topic are placed by the driver's names."""
    wiring = scenario().robots["left"].topics
    joints = ["joint_1", "joint_2"]
    assert wiring.driver_joints(joints) == ["left_joint_1", "left_joint_2"]
    assert wiring.effort_order(joints) == [1, 0]
    assert scenario(effort_joints=None).robots["left"].topics.effort_order(joints) == [0, 1]
    assert scenario().has_robot_state_topics


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"effort_joints": ["left_joint_1"]}, "left.effort_joints: found .*, allowed: each once"),
        ({"effort_joints": ["joint_1", "joint_2"]}, "'left_joint_1', 'left_joint_2'"),
        (
            {"effort_topic": None, "effort_joints": None},
            "left.gravity_compensated: found no effort_topic, allowed: only with effort_topic",
        ),
        ({"joint_states_topic": None}, "left.joint_states_topic: found nothing, allowed: a topic"),
        ({"joint_states_rate": -1.0}, "left.joint_states_rate"),
    ],
)
def test_what_does_not_fit_is_refused(changes: dict[str, Any], expected: str) -> None:
    """The error names the key, what was found and what is allowed."""
    with pytest.raises(ScenarioError, match=expected):
        scenario(**changes)
