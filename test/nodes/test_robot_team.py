# SPDX-License-Identifier: Apache-2.0
"""Node of the simulated team: steps, brakes, pushes, services, clock."""

from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from harness import Ros, paper, unpause
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
from waiting import until

from noninteract_ros.clock import tick_stamp
from noninteract_ros.nodes.common.descriptions import LATCHED_QOS
from noninteract_ros.nodes.messages.cdr import JointStateCodec
from noninteract_ros.nodes.messages.messages import to_wrench_stamped

JOINTS = ["robot_1/x", "robot_1/y", "robot_2/x", "robot_2/y"]
ALONE: dict[str, Any] = {"object": None, "haptic": None, "planner": None, "lockstep_sources": None}


class CommandedTeam:
    """Simulated team with commands published by the test."""

    def __init__(self, ros: Ros, **changes: Any) -> None:
        values = paper(**(ALONE | changes))
        self.ros, self.monitor = ros, ros.monitor(values)
        self._codec = JointStateCodec(JOINTS)
        self._publisher = ros.probe.create_publisher(JointState, "joint_commands", 10)
        self.team = ros.make("robot_team", values)
        ros.wait_for_subscribers(self._publisher)
        until(lambda: self.monitor.states or values.get("start_paused"), "the first state")

    def command(self, tick: int, torque: list[float]) -> None:
        """Publish the command that answers a state in lockstep."""
        self.publish(tick_stamp(tick, 1000.0), torque)

    def publish(self, stamp: int, torque: list[float]) -> None:
        """Publish a command that answers the state with a stamp [ns]."""
        self._publisher.publish(self._codec.encode(stamp, effort=np.array(torque)))

    def step(self, tick: int, torque: list[float]) -> None:
        """Answer a state and wait for the next one."""
        self.command(tick, torque)
        until(lambda: tick_stamp(tick + 1, 1000.0) in self.monitor.states, f"state {tick + 1}")

    def wait_for_status(self, text: str) -> None:
        self.monitor.wait_for_status("robot_team", text)


def test_each_command_is_one_tick(ros: Ros) -> None:
    """v grows by F/m h; the state has the applied torque; other commands are ignored."""
    robot_team = CommandedTeam(ros)
    force = [1.0, 2.0, 3.0, 4.0]
    robot_team.step(0, force)
    robot_team.command(0, [9.0] * 4)  # A second answer to the same state ...
    robot_team.command(5, [9.0] * 4)  # ... and an answer to a state never published.
    robot_team.step(1, force)
    t, _, v, effort = robot_team.monitor.history(robot_team.monitor.states)
    np.testing.assert_array_equal(t, [0.0, 0.001, 0.002])
    masses = np.array([1.0, 1.0, 2.0, 2.0])
    np.testing.assert_allclose(v[2], 2 * 0.001 * np.array(force) / masses, rtol=1e-12)
    np.testing.assert_array_equal(effort, [[0.0] * 4, force, force])
    until(
        lambda: robot_team.monitor.value("robot_team", "rejected inputs") == "1", "the rejection"
    )
    assert "answers no state" in robot_team.monitor.value("robot_team", "last rejection")


def test_an_unanswered_state_is_published_again(ros: Ros) -> None:
    """The same message is published until it is answered."""
    robot_team = CommandedTeam(ros)
    states: list[bytes] = []
    ros.probe.create_subscription(JointState, "joint_states", states.append, 10, raw=True)
    until(lambda: len(states) >= 2, "the state again")
    assert set(states) == {robot_team.monitor.states[0]}
    robot_team.wait_for_status("waiting for the first command")


def test_pause_step_reset(ros: Ros) -> None:
    """A paused team steps once per call; a reset restores the initial state while time goes on."""
    robot_team = CommandedTeam(ros, start_paused=True)
    robot_team.wait_for_status("paused")
    robot_team.monitor.wait_for_timers("robot_team")
    early = ros.call(Trigger, "robot_team/step")
    assert not early.success
    assert "no command" in early.message
    ros.drain()
    assert robot_team.monitor.received["joint_states"] == 1
    robot_team.command(0, [1.0] * 4)
    until(lambda: ros.call(Trigger, "robot_team/step").success, "a step")
    until(lambda: 10**6 in robot_team.monitor.states)
    unpause(ros)
    assert not ros.call(Trigger, "robot_team/step").success
    robot_team.step(1, [1.0] * 4)
    assert ros.call(Trigger, "robot_team/reset").success
    until(lambda: 3 * 10**6 in robot_team.monitor.states, "the state after the reset")
    robot_team.step(3, [0.0] * 4)
    ros.call(SetBool, "robot_team/pause", SetBool.Request(data=True))
    robot_team.wait_for_status("paused")
    _, q, v, _ = robot_team.monitor.history(robot_team.monitor.states)
    np.testing.assert_array_equal(q[3:], [[0.3, 0.4, -0.3, -0.4]] * 2)
    assert v[2].all()
    assert not v[3:].any()


def test_clock_and_external_wrenches_are_published_with_the_states(ros: Ros) -> None:
    """/clock has simulated time; each robot has a wrench at the telemetry rate."""
    clock: list[int] = []
    wrenches: list[WrenchStamped] = []

    def on_clock(message: Clock) -> None:
        clock.append(message.clock.sec * 10**9 + message.clock.nanosec)

    ros.probe.create_subscription(Clock, "/clock", on_clock, 10)
    ros.probe.create_subscription(WrenchStamped, "robot_2/external_wrench", wrenches.append, 10)
    robot_team = CommandedTeam(ros, publish_clock=True, object=paper()["object"])
    until(lambda: clock and wrenches, "clock and wrench")
    for tick in range(8):
        robot_team.step(tick, [0.0] * 4)
    until(lambda: clock[-1] == 8 * 10**6 and wrenches[-1].header.stamp.nanosec == 8 * 10**6)
    assert sorted(set(clock)) == [10**6 * tick for tick in range(9)]
    assert sorted({item.header.stamp.nanosec for item in wrenches}) == [0, 4 * 10**6, 8 * 10**6]
    assert wrenches[-1].header.frame_id == "world"
    assert wrenches[-1].wrench.force.x


@pytest.mark.parametrize("frame", ["", "world", "robot_2/tool"])
def test_a_push_acts_on_its_robot_until_it_times_out(ros: Ros, frame: str) -> None:
    """It acts on that robot alone, for `push_timeout` unless it is repeated."""
    robot_team = CommandedTeam(ros, push_timeout=0.003)
    push = ros.probe.create_publisher(WrenchStamped, "robot_2/push", 10)
    wrenches: list[WrenchStamped] = []
    ros.probe.create_subscription(WrenchStamped, "robot_2/external_wrench", wrenches.append, 10)
    ros.wait_for_subscribers(push)
    until(lambda: wrenches)
    push.publish(to_wrench_stamped(0, np.array([2.0, -4.0, 0.0, 0.0, 0.0, 0.0]), frame))
    until(lambda: wrenches[-1].wrench.force.x == 2.0, "the push among the external wrenches")
    for tick in range(6):
        robot_team.step(tick, [0.0] * 4)
    _, _, v, _ = robot_team.monitor.history(robot_team.monitor.states)
    np.testing.assert_allclose(v[-1], [0.0, 0.0, 0.003, -0.006], rtol=1e-9)


def test_the_team_brakes_without_commands_in_wall_time(ros: Ros) -> None:
    """A command is held for `command_timeout`; then damping acts until the next command."""
    robot_team = CommandedTeam(ros, lockstep=False, rate=200.0, command_timeout=0.2)
    robot_team.wait_for_status("waiting for the first command")

    def speed() -> float:
        return float(np.abs(robot_team.monitor.newest().velocity).max())

    def command_motion() -> bool:
        stamp = max(robot_team.monitor.states)
        robot_team.publish(stamp, [3.0] * 4)
        return speed() > 0.1

    until(command_motion, "the team moves")
    robot_team.wait_for_status("braking: command timeout")
    until(lambda: speed() < 1e-3, "the team is at rest")
    _, _, v, effort = robot_team.monitor.history(dict(robot_team.monitor.states))
    braking = slice(-10, None)
    np.testing.assert_allclose(effort[braking][1:], -20.0 * v[braking][:-1], rtol=1e-9)
    until(command_motion, "the team moves again")
    robot_team.publish(1, [3.0] * 4)
    until(lambda: "s old" in robot_team.monitor.value("robot_team", "last rejection"))


def test_descriptions_are_latched(ros: Ros) -> None:
    """A late subscriber receives the URDF of each robot."""
    CommandedTeam(ros)
    descriptions: dict[str, str] = {}
    for name in ("robot_1", "robot_2"):

        def on_description(message: String, name: str = name) -> None:
            descriptions[name] = message.data

        ros.probe.create_subscription(
            String, f"{name}/robot_description", on_description, LATCHED_QOS
        )
    until(lambda: len(descriptions) == 2, "both descriptions")
    for name, text in descriptions.items():
        assert f'<robot name="{name}">' in text
