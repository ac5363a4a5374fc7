# SPDX-License-Identifier: Apache-2.0
"""Programs with topics for each robot: the same motion as in the rehearsal."""

import signal
from typing import Any

import numpy as np
import pytest
from harness import Ros, TeamMonitor, merged, unpause
from programs import Programs
from repository import ROOT
from std_msgs.msg import Float64MultiArray, MultiArrayDimension
from waiting import DEADLINE, until

from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import read_parameters
from noninteract_ros.scenario.rehearsal import rehearse

NAMES = ["robot_team", "controller", "haptic_emulator", "relative_planner"]


def own_robots(**changes: Any) -> dict[str, Any]:
    return merged(read_parameters(ROOT / "config" / "own_robots.yaml"), changes)


def test_topics_of_each_robot_do_not_change_a_lockstep_run(ros: Ros, programs: Programs) -> None:
    """States over 0.5 s of motion equal the rehearsal, up to rounding of gravity."""
    values = own_robots(end_time=0.5, start_paused=True, haptic={"start_time": 0.05})
    monitor = ros.monitor(values)
    programs.start_all(NAMES, values, monitor)
    unpause(ros)
    monitor.wait_for_status("robot_team", "finished")
    _, q, v, effort = monitor.history(monitor.states)
    expected = rehearse(Scenario.from_dict(values), 0.5)
    assert len(q) == 501
    assert np.abs(expected.q[-1] - expected.q[0]).max() > 1e-3
    np.testing.assert_allclose(q[:-1], expected.q, atol=1e-12)
    np.testing.assert_allclose(v[:-1], expected.v, atol=1e-12)
    np.testing.assert_allclose(effort[1:], expected.torque, atol=1e-9)


# Slow and compliant enough for any machine.
WALL: dict[str, Any] = {
    "lockstep": False,
    "rate": 200.0,
    "telemetry_rate": 50.0,
    "max_state_skew": 0.3,
    "command_timeout": 0.5,
    "state_timeout": 1.0,
    "right": {"joint_states_rate": 100.0},
    "cooperative": {"stiffness": [40.0], "damping": [40.0], "takeover": "shaped"},
    "relative": {"stiffness": [60.0], "damping": [30.0], "takeover": "shaped"},
    "haptic": {"motion": "still", "centre": [0.0, 0.5], "start_time": 0.0, "update_rate": 50.0},
}


def test_arms_reach_a_reference_in_wall_time(ros: Ros, programs: Programs) -> None:
    """Two arms with different stamps follow the reference; without a controller they brake."""
    values = own_robots(**WALL)
    monitor = ros.monitor(values)
    team = Scenario.from_dict(values).build_team()

    def centre() -> Any:
        newest = monitor.newest().position if monitor.states else team.q0
        return team.state(np.array(newest), np.zeros(4)).tool_positions[:, ::2].mean(axis=0)

    programs.start_all(NAMES, values, monitor)
    until(lambda: np.abs(centre() - [0.0, 0.5]).max() < 0.01, "the reference reached")
    programs.kill("controller")
    monitor.wait_for_status("robot_team", "braking: command timeout")


def test_the_controller_brakes_the_team_on_shutdown(ros: Ros, programs: Programs) -> None:
    """Its last command is gravity alone, since effort controllers hold it indefinitely."""
    circle = {"motion": "circle", "centre": [0.0, 0.6], "start_time": 0.0, "ramp_time": 1.0}
    values = own_robots(**merged(WALL, {"haptic": circle}))
    monitor = ros.monitor(values)
    torques: dict[str, list[float]] = {}
    for side in ("left", "right"):

        def on_torques(message: Float64MultiArray, side: str = side) -> None:
            torques[side] = list(message.data)

        topic = f"{side}_effort_controller/commands"
        ros.probe.create_subscription(Float64MultiArray, topic, on_torques, 10)
    programs.start_all(NAMES, values, monitor)
    until(
        lambda: monitor.states and np.abs(monitor.newest().velocity).max() > 0.1, "the team moves"
    )
    controller = programs.running["controller"]
    controller.send_signal(signal.SIGINT)
    assert controller.wait(DEADLINE) == 0, programs.log("controller")
    last = monitor.newest()
    assert np.abs(last.velocity).max() < 0.02
    gravity = Scenario.from_dict(values).build_team().gravity(last.position)
    until(lambda: torques["left"] == [0.0, 0.0], "gravity alone for the left arm")
    np.testing.assert_allclose(torques["right"], gravity[2:], rtol=0.01)


@pytest.mark.parametrize("label", ["", "state stamp 0000000000000000007 ns"])
def test_torques_without_a_valid_stamp_are_rejected_in_lockstep(ros: Ros, label: str) -> None:
    """The reason is reported, and the team does not step."""
    values = own_robots(haptic=None, planner=None, lockstep_sources=None)
    monitor: TeamMonitor = ros.monitor(values)
    team = ros.make("robot_team", values)
    sides = [
        ros.probe.create_publisher(Float64MultiArray, f"{side}_effort_controller/commands", 1)
        for side in ("left", "right")
    ]
    ros.wait_for_subscribers(*sides)
    for publisher in sides:
        message = Float64MultiArray(data=[0.0, 0.0])
        message.layout.dim = [MultiArrayDimension(label=label, size=2, stride=2)]
        publisher.publish(message)
    expected = "answers no state" if label else "no stamp of the answered state"
    until(lambda: expected in monitor.value("robot_team", "last rejection"), "the rejection")
    assert team._simulation.tick == 0
