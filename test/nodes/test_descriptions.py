# SPDX-License-Identifier: Apache-2.0
"""Robot descriptions on topics: wait, check, and changes while a node runs."""

import signal
import threading
import time
from typing import Any

import numpy as np
import pytest
from harness import Ros, merged
from programs import Programs
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from repository import ROOT
from std_msgs.msg import String
from waiting import DEADLINE, until

from noninteract_ros.errors import ScenarioError
from noninteract_ros.nodes.common.descriptions import LATCHED_QOS
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import read_parameters

PLANAR = read_parameters(ROOT / "config" / "planar_arms.yaml")
TEXTS = {
    name: Scenario.from_dict(PLANAR).robots[name].description(name) for name in ("left", "right")
}
TOPICS = {"left": "/left/robot_description", "right": "right_described"}
SOURCELESS: dict[str, Any] = {"haptic": None, "planner": None, "lockstep_sources": None}


def on_topics(**changes: Any) -> dict[str, Any]:
    """Return the scenario `planar_arms` with descriptions on topics."""
    values = merged(PLANAR, SOURCELESS | {"force_sensors": None})
    for name, topic in TOPICS.items():
        kept = ("base_pose", "initial_position", "effort_limit", "velocity_limit")
        block = {key: values[name][key] for key in kept}
        urdf = {"model": "urdf", "urdf": f"topic:{topic}", "tool_frame": "tool"}
        values[name] = block | urdf
    return merged(values, changes)


class NodeInThread:
    """Node constructed in a thread, since its constructor waits.

    Attributes:
        node: Node, or None while its constructor waits.
        error: Exception of the constructor, or None.
    """

    def __init__(self, ros: Ros, name: str, values: dict[str, Any]) -> None:
        self.node: Any = None
        self.error: Exception | None = None
        self._thread = threading.Thread(target=self._make, args=(ros, name, values), daemon=True)
        self._thread.start()

    def _make(self, ros: Ros, name: str, values: dict[str, Any]) -> None:
        try:
            self.node = ros.make(name, values)
        except Exception as error:
            self.error = error

    def constructed(self) -> bool:
        if self.error:
            raise self.error
        return self.node is not None


@pytest.fixture
def publish(ros: Ros) -> Any:
    """Publish the description of a robot, and wait until it is processed."""
    publishers = {
        name: ros.probe.create_publisher(String, topic, LATCHED_QOS)
        for name, topic in TOPICS.items()
    }

    def publish_text(name: str, text: str) -> None:
        publishers[name].publish(String(data=text))
        ros.drain()

    return publish_text


def test_a_controller_waits_for_valid_descriptions(ros: Ros, publish: Any) -> None:
    """Diagnostics have the missing and rejected descriptions; the last one builds the node."""
    values = on_topics()
    monitor = ros.monitor(PLANAR)
    controller = NodeInThread(ros, "controller", values)
    both = "description of left on /left/robot_description, right on /team/right_described"
    monitor.wait_for_status("controller", f"waiting for the {both}")
    publish("right", TEXTS["right"])
    monitor.wait_for_status("controller", "description of left on /left/robot_description")
    for text, expected in (
        ("<robot", "text that is not XML"),
        ("<sdf/>", "XML with the root <sdf>"),
        (
            "<robot><link name='a'/><joint name='b' type='fixed'/></robot>",
            "a URDF that cannot be parsed",
        ),
    ):
        publish("left", text)
        until(
            monitor.has_status(
                "controller",
                f"rejected the description of left on /left/robot_description: found {expected}",
            ),
            expected,
        )
        assert monitor.status["controller"][0] == 2
    publish("left", TEXTS["left"])
    until(controller.constructed, "the controller")
    monitor.wait_for_status("controller", "waiting for the first state")
    team = controller.node.core.team
    expected_team = Scenario.from_dict(PLANAR).build_team()
    v = np.array([0.5, -1.0, 2.0, 0.3])
    positions = team.joints_from_configuration(team.q0)
    np.testing.assert_allclose(positions, expected_team.q0, atol=1e-12)
    np.testing.assert_allclose(
        team.inverse_dynamics(team.q0, v, v),
        expected_team.inverse_dynamics(expected_team.q0, v, v),
        atol=1e-9,
    )


@pytest.mark.parametrize("lockstep", [True, False])
def test_a_changed_description_holds_the_team(ros: Ros, publish: Any, lockstep: bool) -> None:
    """An unchanged one has no effect; a changed one holds the team until a restart."""
    for name, text in TEXTS.items():
        publish(name, text)
    values = on_topics(rate=100.0, telemetry_rate=100.0, lockstep=lockstep)
    monitor = ros.monitor(PLANAR)
    nodes = [NodeInThread(ros, name, values) for name in ("robot_team", "controller")]
    for item in nodes:
        until(item.constructed, "the node")
    monitor.wait_for_status("controller", "holding cooperative, relative: source silent")
    publish("left", TEXTS["left"] + "\n")
    assert not nodes[1].node.descriptions.problem
    publish("left", TEXTS["left"].replace("1.0", "2.0"))
    text = "the description of left has changed; restart the node"
    for name in ("controller", "robot_team"):
        monitor.wait_for_status(name, text)
        assert monitor.status[name][0] == 2
    publish("left", TEXTS["left"])
    assert nodes[1].node.descriptions.problem == text
    monitor.wait_for_timers("controller")
    # In wall time a loaded machine appends that it is late.
    assert monitor.status["controller"][1].startswith(f"holding: {text}")
    assert nodes[1].node.core.mode.stopped


def test_a_scenario_that_does_not_fit_a_description_is_an_error(ros: Ros, publish: Any) -> None:
    """A valid description with an invalid key is an error of the scenario, so the node ends."""
    for name, text in TEXTS.items():
        publish(name, text)
    controller = NodeInThread(ros, "controller", on_topics(left={"tool_frame": "hand"}))
    with pytest.raises(ScenarioError, match=r"left.tool_frame: found 'hand', allowed: .*tool"):
        until(controller.constructed, "the error")


def test_descriptions_of_volatile_publishers_are_received(ros: Ros) -> None:
    """A publisher that repeats its message need not be latched, nor reliable."""
    waiting = NodeInThread(ros, "controller", on_topics())
    publishers = {
        topic: ros.probe.create_publisher(String, topic, qos)
        for topic, qos in zip(
            TOPICS.values(), (QoSProfile(depth=1), qos_profile_sensor_data), strict=True
        )
    }
    texts = dict(zip(TOPICS.values(), TEXTS.values(), strict=True))

    def repeated() -> bool:
        for topic, publisher in publishers.items():
            publisher.publish(String(data=texts[topic]))
        time.sleep(0.1)
        return waiting.constructed()

    until(repeated, "both descriptions")


def test_a_scenario_read_without_ros_needs_a_description() -> None:
    """The error has the command that creates one."""
    with pytest.raises(ScenarioError, match=r"left.urdf: .* a file by `noninteract describe`"):
        Scenario.from_dict(on_topics())


def test_a_waiting_program_ends_on_sigint(ros: Ros, programs: Programs) -> None:
    """Exit status 0, no traceback."""
    monitor = ros.monitor(PLANAR)
    process = programs.start("controller", on_topics())
    monitor.wait_for_status("controller", "waiting for the description")
    process.send_signal(signal.SIGINT)
    assert process.wait(DEADLINE) == 0
    assert "Traceback" not in programs.log("controller")
