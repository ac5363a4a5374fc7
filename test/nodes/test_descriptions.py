# SPDX-License-Identifier: Apache-2.0
"""URDFs on topics: waited for, checked, and not to be changed while something runs."""

import signal
import threading
from typing import Any

import numpy as np
import pytest
from harness import Ros, merged
from programs import Programs
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
    """The scenario planar_arms, its arms described on topics."""
    values = merged(PLANAR, SOURCELESS | {"force_sensors": None})
    for name, topic in TOPICS.items():
        kept = ("base_pose", "initial_position", "effort_limit", "velocity_limit")
        block = {key: values[name][key] for key in kept}
        urdf = {"model": "urdf", "urdf": f"topic:{topic}", "tool_frame": "tool"}
        values[name] = block | urdf
    return merged(values, changes)


class Waiting:
    """A node that is made in a thread of its own, for it waits."""

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

    def made(self) -> bool:
        if self.error:
            raise self.error
        return self.node is not None


@pytest.fixture
def say(ros: Ros) -> Any:
    """Publishes a robot's description."""
    publishers = {
        name: ros.probe.create_publisher(String, topic, LATCHED_QOS)
        for name, topic in TOPICS.items()
    }
    return lambda name, text: publishers[name].publish(String(data=text))


def test_a_controller_waits_says_so_refuses_and_goes_on(ros: Ros, say: Any) -> None:
    """Missing descriptions are named; what is no URDF is refused in words; then all is built."""
    values = on_topics()
    monitor = ros.monitor(PLANAR)
    controller = Waiting(ros, "controller", values)
    both = "description of left on /left/robot_description, right on /team/right_described"
    monitor.wait_for_status("controller", f"waiting for the {both}")
    say("right", TEXTS["right"])
    monitor.wait_for_status("controller", "description of left on /left/robot_description")
    for text, expected in (
        ("<robot", "text that is not XML"),
        ("<sdf/>", "XML with the root <sdf>"),
        (
            "<robot><link name='a'/><joint name='b' type='fixed'/></robot>",
            "a URDF that the parser",
        ),
    ):
        say("left", text)
        until(
            monitor.has_status(
                "controller",
                f"rejected the description of left on /left/robot_description: found {expected}",
            ),
            expected,
        )
        assert monitor.status["controller"][0] == 2
    say("left", TEXTS["left"])
    until(controller.made, "the controller")
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
def test_the_same_again_is_no_news_and_another_one_stops(
    ros: Ros, say: Any, lockstep: bool
) -> None:
    """Republished unchanged nothing happens; changed, the team is held still until a restart."""
    for name, text in TEXTS.items():
        say(name, text)
    values = on_topics(rate=100.0, telemetry_rate=100.0, lockstep=lockstep)
    monitor = ros.monitor(PLANAR)
    waiting = [Waiting(ros, name, values) for name in ("robot_team", "controller")]
    for item in waiting:
        until(item.made, "the node")
    monitor.wait_for_status("controller", "holding cooperative, relative: source silent")
    say("left", TEXTS["left"] + "\n")
    until(monitor.has_new_status("controller"))
    until(monitor.has_new_status("controller"))
    assert "changed" not in monitor.status["controller"][1]
    say("left", TEXTS["left"].replace("1.0", "2.0"))
    for name in ("controller", "robot_team"):
        until(
            monitor.has_status(name, "the description of left has changed; restart the node"), name
        )
        assert monitor.status[name][0] == 2
    say("left", TEXTS["left"])
    until(monitor.has_new_status("controller"))
    until(monitor.has_new_status("controller"))
    assert "holding: the description of left has changed" in monitor.status["controller"][1]
    assert waiting[1].node.core.mode.stopped


def test_a_scenario_that_does_not_fit_ends_the_program(ros: Ros, say: Any) -> None:
    """A good description and a wrong key are the scenario's fault: nothing better will come."""
    for name, text in TEXTS.items():
        say(name, text)
    controller = Waiting(ros, "controller", on_topics(left={"tool_frame": "hand"}))
    with pytest.raises(ScenarioError, match=r"left.tool_frame: found 'hand', allowed: .*tool"):
        until(controller.made, "the refusal")


def test_without_a_program_a_topic_is_no_description() -> None:
    """Who only reads the scenario is told what to do."""
    with pytest.raises(ScenarioError, match=r"left.urdf: .* a file by `noninteract describe`"):
        Scenario.from_dict(on_topics())


def test_a_program_that_waits_ends_when_it_is_told_to(ros: Ros, programs: Programs) -> None:
    """Ctrl-C while it waits: exit status 0, no traceback."""
    monitor = ros.monitor(PLANAR)
    process = programs.start("controller", on_topics())
    monitor.wait_for_status("controller", "waiting for the description")
    process.send_signal(signal.SIGINT)
    assert process.wait(DEADLINE) == 0
    assert "Traceback" not in programs.log("controller")
