# SPDX-License-Identifier: Apache-2.0
"""Time of messages: nothing of the past is answered or applied, nothing ahead is believed."""

import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, WrenchStamped
from harness import Ros, paper
from sensor_msgs.msg import JointState
from waiting import DEADLINE, until

from noninteract_ros.errors import InputError
from noninteract_ros.nodes.common.message_time import ClockMonitor, StampChecker
from noninteract_ros.nodes.messages.cdr import JointStateCodec
from noninteract_ros.nodes.messages.messages import to_stamp

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
SECOND = 10**9


class WallController:
    """Controller in wall time with states published by the test."""

    def __init__(self, ros: Ros, **changes: Any) -> None:
        values = paper(**(ALONE | changes))
        self.ros, self.monitor = ros, ros.monitor(values)
        self.states = ros.probe.create_publisher(JointState, "joint_states", 10)
        self.node = ros.make("controller", values)
        commands = [item for item in self.node.publishers if "joint_commands" in item.topic_name]
        until(lambda: self.states.get_subscription_count() == 2, "both subscribers of states")
        ros.wait_for_subscribers(*commands)

    def now(self) -> int:
        return int(self.ros.probe.get_clock().now().nanoseconds)

    def publish(self, stamp: int) -> int:
        """Publish a state of the team at rest and return its stamp."""
        zeros = np.zeros(4)
        self.states.publish(CODEC.encode(stamp, np.array([0.3, 0.4, -0.3, -0.4]), zeros, zeros))
        return stamp

    def rejection(self, text: str) -> Callable[[], bool]:
        return lambda: text in self.monitor.value("controller", "last rejection")

    def expect_answer(self) -> None:
        """Publish states until one is answered."""

        def answered() -> bool:
            stamps = {self.publish(self.now())}
            time.sleep(0.02)
            return bool(stamps & self.monitor.commands.keys())

        until(answered, "an answer to a true state")


def test_states_of_the_past_are_not_answered(ros: Ros) -> None:
    """A state 2 s old, as after a pause of the controller, is rejected; the next is answered."""
    controller = WallController(ros)
    controller.expect_answer()
    old = controller.publish(controller.now() - 2 * SECOND)
    until(controller.rejection("s old, allowed: 1 s"), "the rejection")
    controller.expect_answer()
    assert old not in controller.monitor.commands


def test_only_the_newest_of_many_states_is_answered(ros: Ros) -> None:
    """A queue of states, as after a pause, has one answer."""
    controller = WallController(ros)
    controller.expect_answer()
    reached, released = threading.Event(), threading.Event()
    controller.node._post(reached.set)
    controller.node._post(released.wait)
    assert reached.wait(DEADLINE)
    start = controller.now()
    stamps = [controller.publish(start + 1000 * i) for i in range(8)]
    ros.drain()
    released.set()
    until(lambda: stamps[-1] in controller.monitor.commands, "the answer to the newest")
    assert not set(stamps[:-1]) & controller.monitor.commands.keys()


def test_states_stamped_ahead_do_not_shut_out_true_ones(ros: Ros) -> None:
    """False states 0.9 s and 68 years ahead are rejected; true ones are answered at once."""
    controller = WallController(ros)
    controller.expect_answer()
    for lead in (900_000_000, 2**31 * SECOND - controller.now() - SECOND):
        ahead = controller.publish(controller.now() + lead)
        until(controller.rejection("s ahead, allowed"), "the rejection")
        stamp = controller.publish(controller.now())
        until(lambda stamp=stamp: stamp in controller.monitor.commands, "the true answer")
        assert ahead not in controller.monitor.commands


def test_inputs_of_the_past_and_stamped_ahead_are_rejected(ros: Ros) -> None:
    """Set-points and forces older than their timeout, or ahead, do not reach the core."""
    controller = WallController(ros)
    source = controller.node.core.inputs["cooperative"].sources["human"]
    pose, wrench = PoseStamped(), WrenchStamped()
    pose.pose.position.x = wrench.wrench.force.x = 1.0
    kinds = {"target_pose": pose, "wrench": wrench}
    publishers = {
        kind: ros.probe.create_publisher(type(message), f"cooperative/human/{kind}", 10)
        for kind, message in kinds.items()
    }
    ros.wait_for_subscribers(*publishers.values())
    for offset, text in ((-3 * SECOND, "s old"), (SECOND // 2, "s ahead")):
        for kind, message in kinds.items():

            def rejected(kind: str = kind, message: Any = message) -> bool:
                controller.publish(controller.now())
                message.header.stamp = to_stamp(controller.now() + offset)  # noqa: B023
                publishers[kind].publish(message)
                time.sleep(0.05)
                last = controller.monitor.value("controller", "last rejection")
                return last.startswith(f"cooperative/human/{kind}") and text in last  # noqa: B023

            until(rejected, f"the rejection of {kind}")
    assert source.motion(np.inf) is None
    assert source.force(np.inf) is None


def checker(now: list[int]) -> StampChecker:
    return StampChecker(lambda: now[0], 0.01, 0.1)


def test_rejected_stamps_have_no_effect_on_later_ones() -> None:
    """Neither stamps ahead nor stamps of the past move the order."""
    now = [SECOND]
    stamps = checker(now)
    assert not stamps.accept("topic", SECOND)
    for wrong in (SECOND + 20 * 10**6, 2**31 * SECOND, SECOND - 200 * 10**6, 0):
        with pytest.raises(InputError, match=r"ahead|old"):
            stamps.accept("topic", wrong)
    assert stamps.last("topic") == SECOND
    now[0] += 10**6
    assert not stamps.accept("topic", SECOND + 10**6)
    with pytest.raises(InputError, match="goes back"):
        stamps.accept("topic", SECOND)


def test_jumps_of_the_clock_are_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """A step of the clock by 3 s is named with its direction."""
    start, jump = time.time_ns() - time.monotonic_ns(), [0]
    monitor = ClockMonitor(lambda: time.monotonic_ns() + start + jump[0])
    monitor.update()
    monitor.update()
    assert monitor.problem() == ""
    jump[0] = -3 * SECOND
    until(lambda: monitor.update() or monitor.problem(), "the jump")
    assert monitor.problem() == "the clock has jumped back by 3 s"
