# SPDX-License-Identifier: Apache-2.0
"""The team's node: steps, brakes, pushes, services, clock."""

from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from harness import Ros, go, paper
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


class Bench:
    """A team alone, whose commands the test gives."""

    def __init__(self, ros: Ros, **changes: Any) -> None:
        values = paper(**(ALONE | changes))
        self.ros, self.ear = ros, ros.ear(values)
        self._codec = JointStateCodec(JOINTS)
        self._publisher = ros.probe.create_publisher(JointState, "joint_commands", 10)
        self.team = ros.make("robot_team", values)
        ros.matched(self._publisher)
        until(lambda: self.ear.states or values.get("start_paused"), "the first state")

    def command(self, tick: int, torque: list[float]) -> None:
        """Answers a state of lockstep."""
        self.publish(tick_stamp(tick, 1000.0), torque)

    def publish(self, stamp: int, torque: list[float]) -> None:
        """A command that answers the state with a stamp [ns]."""
        self._publisher.publish(self._codec.encode(stamp, effort=np.array(torque)))

    def step(self, tick: int, torque: list[float]) -> None:
        """Answers a state and waits for the next."""
        self.command(tick, torque)
        until(lambda: tick_stamp(tick + 1, 1000.0) in self.ear.states, f"state {tick + 1}")

    def says(self, text: str) -> None:
        until(self.ear.says("robot_team", text), text)


def test_each_command_is_one_tick(ros: Ros) -> None:
    """v grows by F/m h; the state tells the torque that led to it; other answers do nothing."""
    bench = Bench(ros)
    force = [1.0, 2.0, 3.0, 4.0]
    bench.step(0, force)
    bench.command(0, [9.0] * 4)  # The same state answered twice ...
    bench.command(5, [9.0] * 4)  # ... and one that was never sent.
    bench.step(1, force)
    t, _, v, effort = bench.ear.history(bench.ear.states)
    np.testing.assert_array_equal(t, [0.0, 0.001, 0.002])
    masses = np.array([1.0, 1.0, 2.0, 2.0])
    np.testing.assert_allclose(v[2], 2 * 0.001 * np.array(force) / masses, rtol=1e-12)
    np.testing.assert_array_equal(effort, [[0.0] * 4, force, force])
    until(lambda: bench.ear.value("robot_team", "rejected inputs") == "1", "the refusal")
    assert "answers no state" in bench.ear.value("robot_team", "last rejection")


def test_an_unanswered_state_is_sent_again(ros: Ros) -> None:
    """The same message comes until somebody answers."""
    bench = Bench(ros)
    heard: list[bytes] = []
    ros.probe.create_subscription(JointState, "joint_states", heard.append, 10, raw=True)
    until(lambda: len(heard) >= 2, "the state again")
    assert set(heard) == {bench.ear.states[0]}
    bench.says("waiting for the first command")


def test_pause_step_reset(ros: Ros) -> None:
    """A paused team steps once per call; a reset puts it back while time goes on."""
    bench = Bench(ros, start_paused=True)
    bench.says("paused")
    assert not bench.ear.states
    early = ros.call(Trigger, "robot_team/step")
    assert not early.success
    assert "no command" in early.message
    until(lambda: 0 in bench.ear.states)
    bench.command(0, [1.0] * 4)
    until(lambda: ros.call(Trigger, "robot_team/step").success, "a step")
    until(lambda: 10**6 in bench.ear.states)
    go(ros)
    assert not ros.call(Trigger, "robot_team/step").success
    bench.step(1, [1.0] * 4)
    assert ros.call(Trigger, "robot_team/reset").success
    until(lambda: 3 * 10**6 in bench.ear.states, "the state after the reset")
    bench.step(3, [0.0] * 4)
    ros.call(SetBool, "robot_team/pause", SetBool.Request(data=True))
    bench.says("paused")
    _, q, v, _ = bench.ear.history(bench.ear.states)
    np.testing.assert_array_equal(q[3:], [[0.3, 0.4, -0.3, -0.4]] * 2)
    assert v[2].all()
    assert not v[3:].any()


def test_clock_and_external_wrenches_come_with_the_states(ros: Ros) -> None:
    """/clock tells simulated time where asked; a wrench per robot at the telemetry rate."""
    clock: list[int] = []
    wrenches: list[WrenchStamped] = []

    def note(message: Clock) -> None:
        clock.append(message.clock.sec * 10**9 + message.clock.nanosec)

    ros.probe.create_subscription(Clock, "/clock", note, 10)
    ros.probe.create_subscription(WrenchStamped, "robot_2/external_wrench", wrenches.append, 10)
    bench = Bench(ros, publish_clock=True, object=paper()["object"])
    until(lambda: clock and wrenches, "clock and wrench")
    for tick in range(8):
        bench.step(tick, [0.0] * 4)
    until(lambda: clock[-1] == 8 * 10**6 and wrenches[-1].header.stamp.nanosec == 8 * 10**6)
    assert sorted(set(clock)) == [10**6 * tick for tick in range(9)]
    assert sorted({item.header.stamp.nanosec for item in wrenches}) == [0, 4 * 10**6, 8 * 10**6]
    assert wrenches[-1].header.frame_id == "world"
    assert wrenches[-1].wrench.force.x


@pytest.mark.parametrize("frame", ["", "world", "robot_2/tool"])
def test_a_push_acts_on_the_robot_and_lapses(ros: Ros, frame: str) -> None:
    """It acts on its robot alone, for `push_timeout` unless it is repeated."""
    bench = Bench(ros, push_timeout=0.003)
    push = ros.probe.create_publisher(WrenchStamped, "robot_2/push", 10)
    heard: list[WrenchStamped] = []
    ros.probe.create_subscription(WrenchStamped, "robot_2/external_wrench", heard.append, 10)
    ros.matched(push)
    until(lambda: heard)
    push.publish(to_wrench_stamped(0, np.array([2.0, -4.0, 0.0, 0.0, 0.0, 0.0]), frame))
    until(lambda: heard[-1].wrench.force.x == 2.0, "the push among the external wrenches")
    for tick in range(6):
        bench.step(tick, [0.0] * 4)
    _, _, v, _ = bench.ear.history(bench.ear.states)
    np.testing.assert_allclose(v[-1], [0.0, 0.0, 0.003, -0.006], rtol=1e-9)


def test_without_commands_the_team_brakes_in_wall_time(ros: Ros) -> None:
    """A command is held for `command_timeout`; then damping alone acts, until commands return."""
    bench = Bench(ros, lockstep=False, rate=200.0, command_timeout=0.2)
    bench.says("waiting for the first command")

    def speed() -> float:
        return float(np.abs(bench.ear.newest().velocity).max())

    def push_on() -> bool:
        stamp = max(bench.ear.states)
        bench.publish(stamp, [3.0] * 4)
        return speed() > 0.1

    until(push_on, "the team moves")
    bench.says("braking: command timeout")
    until(lambda: speed() < 1e-3, "the team is at rest")
    _, _, v, effort = bench.ear.history(dict(bench.ear.states))
    braking = slice(-10, None)
    np.testing.assert_allclose(effort[braking][1:], -20.0 * v[braking][:-1], rtol=1e-9)
    until(push_on, "the team moves again")
    bench.publish(1, [3.0] * 4)
    until(lambda: "goes back" in bench.ear.value("robot_team", "last rejection"))


def test_descriptions_are_there_for_whoever_comes_later(ros: Ros) -> None:
    """Each robot's URDF is heard after it was published, under the robot's name."""
    Bench(ros)
    heard: dict[str, str] = {}
    for name in ("robot_1", "robot_2"):

        def note(message: String, name: str = name) -> None:
            heard[name] = message.data

        ros.probe.create_subscription(String, f"{name}/robot_description", note, LATCHED_QOS)
    until(lambda: len(heard) == 2, "both descriptions")
    for name, text in heard.items():
        assert f'<robot name="{name}">' in text
