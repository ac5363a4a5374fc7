# SPDX-License-Identifier: Apache-2.0
"""Force sensors that end: their wrenches age out, and forces regulated by them are released."""

from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from harness import Ros, paper
from sensor_msgs.msg import JointState
from test_message_time import CODEC, WallController
from waiting import until

from noninteract_ros.nodes.messages.messages import to_wrench_stamped

GOAL = {"relative": {"force": [4.0, 0.0], "force_gain": [1.0, 1.0]}}
WRENCH = np.array([2.0, 0.0, 0.0, 0.0, 0.0, 0.0])
SILENT = "no external_wrench of robot_2, by which a force is regulated"


@pytest.mark.parametrize("goal", [{}, GOAL], ids=["measured", "regulated"])
def test_a_silent_sensor_ages_out_in_wall_time(ros: Ros, goal: dict[str, Any]) -> None:
    """Its wrench becomes zero and is named; a force regulated by it is released and returns."""
    controller = WallController(ros, force_sensors=["robot_2"], state_timeout=0.5, **goal)
    sensor = ros.probe.create_publisher(WrenchStamped, "robot_2/external_wrench", 10)
    ros.wait_for_subscribers(sensor)
    node = controller.node

    def measured() -> bool:
        controller.publish(controller.now())
        sensor.publish(to_wrench_stamped(controller.now(), WRENCH))
        return bool(node._telemetry.wrenches[1, 0] == 2.0 and not node.core.mode.stopped)

    def silent() -> bool:
        controller.publish(controller.now())
        text = SILENT if goal else "running without robot_2/external_wrench"
        return controller.monitor.has_status("controller", text)()

    until(measured, "the wrench")
    until(silent, "the silence in diagnostics")
    assert node.core.mode.stopped == bool(goal)
    assert not node._telemetry.wrenches.any()
    until(measured, "the wrench again")


def test_lockstep_waits_for_no_sensor_for_ever(ros: Ros) -> None:
    """After `lockstep_timeout` the state is answered, and the sensor is named."""
    alone = {"haptic": None, "planner": None, "lockstep_sources": None, "object": None}
    values = paper(**alone, force_sensors=["robot_2"], lockstep_timeout=0.5)
    monitor = ros.monitor(values)
    controller = ros.make("controller", values)
    states = ros.probe.create_publisher(JointState, "joint_states", 10)
    commands = [item for item in controller.publishers if "joint_commands" in item.topic_name]
    ros.wait_for_subscribers(states, *commands)
    states.publish(CODEC.encode(0, np.array([0.3, 0.4, -0.3, -0.4]), np.zeros(4), np.zeros(4)))
    until(lambda: 0 in monitor.commands, "the answer")
    monitor.wait_for_status("controller", "running without robot_2/external_wrench")
