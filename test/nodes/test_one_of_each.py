# SPDX-License-Identifier: Apache-2.0
"""One controller for one team: second publishers are named, and nothing of them is applied."""

from typing import Any

import numpy as np
import rclpy
from harness import Ros, TeamMonitor, paper
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from waiting import until

from noninteract_ros.nodes.messages.cdr import JointStateCodec

JOINTS = ["robot_1/x", "robot_1/y", "robot_2/x", "robot_2/y"]
CODEC = JointStateCodec(JOINTS)
ALONE: dict[str, Any] = {
    "haptic": None,
    "planner": None,
    "object": None,
    "lockstep_sources": None,
    "force_sensors": None,
    "lockstep": False,
    "rate": 100.0,
    # A busy machine must not make true messages too old for these tests.
    "max_age": 1.0,
    "command_timeout": 1.0,
    "state_timeout": 2.0,
}


class Stranger:
    """Another node with a publisher of joint states or commands."""

    def __init__(self, ros: Ros, monitor: TeamMonitor, topic: str) -> None:
        self._monitor = monitor
        self.node: Node = ros.add_node(
            rclpy.create_node("stranger", namespace="team", context=ros.context)
        )
        self.publisher = self.node.create_publisher(JointState, topic, 10)
        ros.wait_for_subscribers(self.publisher)

    def command(self, torque: float) -> None:
        """Answer the newest state."""
        stamp = next(reversed(self._monitor.states))
        self.publisher.publish(CODEC.encode(stamp, effort=np.full(4, torque)))

    def state(self, position: float) -> None:
        """Publish a state that is newer than the newest one."""
        stamp = self.node.get_clock().now().nanoseconds
        zeros = np.zeros(4)
        self.publisher.publish(CODEC.encode(stamp, np.full(4, position), zeros, zeros))


def text(monitor: TeamMonitor, node: str) -> str:
    return monitor.status.get(node, (0, "waiting", {}))[1]


def test_a_second_commander_is_named_and_moves_nothing(ros: Ros) -> None:
    """The team brakes while there are two, and follows its own controller again afterwards."""
    values = paper(**ALONE)
    monitor = ros.monitor(values)
    ros.make("robot_team", values)
    ros.make("controller", values)
    until(lambda: not monitor.has_status("robot_team", "waiting")() and monitor.commands)
    until(monitor.has_new_status("robot_team"))
    stranger = Stranger(ros, monitor, "joint_commands")
    before = monitor.newest().position

    def named() -> bool:
        stranger.command(50.0)
        return "/team/controller, /team/stranger" in text(monitor, "robot_team")

    until(named, "an error with both names")
    assert monitor.status["robot_team"][0] == 2
    assert text(monitor, "robot_team").startswith("braking")
    for _ in range(20):
        stranger.command(50.0)
        ros.drain()
    # Under 50 N the lighter robot would move by 0.25 m within 0.1 s.
    assert np.abs(monitor.newest().position - before).max() < 0.01
    ros.remove(stranger.node)
    until(lambda: "publishers" not in text(monitor, "robot_team"), "the end of the conflict")
    until(lambda: "braking" not in text(monitor, "robot_team"), "commands in force again")


def test_a_second_team_is_named_and_not_answered(ros: Ros) -> None:
    """The controller holds the team while there are two, and does not answer the other one."""
    values = paper(**ALONE)
    monitor = ros.monitor(values)
    ros.make("robot_team", values)
    controller = ros.make("controller", values)
    until(lambda: monitor.commands, "the first command")
    stranger = Stranger(ros, monitor, "joint_states")

    def named() -> bool:
        stranger.state(5.0)
        return "/team/robot_team, /team/stranger" in text(monitor, "controller")

    until(named, "an error with both names")
    assert monitor.status["controller"][0] == 2
    assert controller.core.mode.stopped
    until(lambda: "joint_states: " in monitor.value("controller", "last rejection"))
    assert "second publisher" in monitor.value("controller", "last rejection")
    ros.remove(stranger.node)
    until(lambda: not controller.core.mode.stopped, "the end of the hold")


def test_a_restarted_controller_takes_over_by_itself(ros: Ros) -> None:
    """The team binds itself to the new one once the old one is gone."""
    values = paper(**ALONE)
    monitor = ros.monitor(values)
    ros.make("robot_team", values)
    first = Stranger(ros, monitor, "joint_commands")
    until(lambda: monitor.states)

    def in_force(commander: Stranger) -> bool:
        commander.command(1e-3)
        return bool(monitor.newest().effort[0] == 1e-3)

    until(lambda: in_force(first), "the command of the first")
    ros.remove(first.node)
    ros.make("controller", values)
    until(lambda: "braking" in text(monitor, "robot_team") or monitor.commands)
    until(
        lambda: (
            monitor.has_status("robot_team", "running")() and monitor.newest().effort[0] != 1e-3
        ),
        "commands of the controller in force",
    )


def test_a_stopped_team_applies_nothing_until_it_is_resumed(ros: Ros) -> None:
    """It brakes by itself, even if the controller has gone and another one commands."""
    values = paper(**ALONE)
    monitor = ros.monitor(values)
    ros.make("robot_team", values)
    controller = ros.make("controller", values)
    until(lambda: monitor.has_status("robot_team", "running")() and monitor.commands)
    assert ros.call(Trigger, "controller/stop").success
    monitor.wait_for_status("robot_team", "stopped until resume")
    before = monitor.newest().position
    ros.remove(controller)
    stranger = Stranger(ros, monitor, "joint_commands")
    for _ in range(20):
        stranger.command(50.0)
        ros.drain()
    assert np.abs(monitor.newest().position - before).max() < 1e-3
    ros.make("controller", values)
    until(monitor.has_new_status("robot_team"))
    assert monitor.has_status("robot_team", "stopped until resume")()
    assert ros.call(Trigger, "controller/resume").success
    until(lambda: "stopped" not in text(monitor, "robot_team"), "the end of the stop")


def test_the_team_can_be_stopped_without_a_controller(ros: Ros) -> None:
    """`~/stop` of the team acts at once, and `~/resume` ends it."""
    values = paper(**ALONE)
    monitor = ros.monitor(values)
    ros.make("robot_team", values)
    commander = Stranger(ros, monitor, "joint_commands")
    until(lambda: monitor.states)

    def moves() -> bool:
        commander.command(3.0)
        return bool(np.abs(monitor.newest().effort).max() == 3.0)

    until(moves, "the torque of the command")
    assert ros.call(Trigger, "robot_team/stop").success
    monitor.wait_for_status("robot_team", "stopped until resume")
    for _ in range(10):
        commander.command(3.0)
        ros.drain()
    assert np.abs(monitor.newest().effort).max() != 3.0
    assert ros.call(Trigger, "robot_team/resume").success
    until(moves, "the torque of the command again")


def test_a_second_commander_is_named_in_lockstep(ros: Ros) -> None:
    """The error has both names."""
    values = paper(**(ALONE | {"lockstep": True}))
    monitor = ros.monitor(values)
    ros.make("robot_team", values)
    ros.make("controller", values)
    until(lambda: monitor.commands)
    Stranger(ros, monitor, "joint_commands")
    monitor.wait_for_status("robot_team", "/team/controller, /team/stranger")
    assert monitor.status["robot_team"][0] == 2
