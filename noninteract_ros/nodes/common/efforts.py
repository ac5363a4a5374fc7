# SPDX-License-Identifier: Apache-2.0
"""Joint torques to and from effort controllers, in the format of ros2_control."""

import re
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from rclpy.duration import Duration
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

from noninteract_ros.arrays import Array
from noninteract_ros.errors import InputError
from noninteract_ros.nodes.common.node import ScenarioNode
from noninteract_ros.nodes.messages.cdr import CdrTemplate, check_finite
from noninteract_ros.team.team import Team

STAMP_DIGITS = 19
ACK_TIMEOUT = Duration(seconds=0.2)
STAMP_LABEL = "state stamp {stamp:0" + str(STAMP_DIGITS) + "d} ns"
STAMP_PATTERN = re.compile(r"state stamp (\d+) ns")


class EffortCodec:
    """std_msgs/Float64MultiArray with one torque per joint, in the order of an effort controller.

    The label of its dimension has the stamp of the answered state. Effort controllers read the
    data only.

    Args:
        order: Model index of the joint of each number in the message.
    """

    def __init__(self, order: list[int]) -> None:
        self._order = np.array(order, dtype=np.intp)
        count = len(order)
        message = Float64MultiArray(data=[0.0] * count)
        label = STAMP_LABEL.format(stamp=0)
        message.layout.dim = [MultiArrayDimension(label=label, size=count, stride=count)]
        self._template = CdrTemplate(message)
        self._stamp_at = self._template.encode(np.zeros(count)).index(b"0" * STAMP_DIGITS)

    def encode(self, stamp_ns: int, torque: Array) -> bytes:
        """Return the serialized message of torques in model order, shape (n,) [N or N m]."""
        data = bytearray(self._template.encode(torque[self._order]))
        digits = f"{stamp_ns:0{STAMP_DIGITS}d}".encode()
        data[self._stamp_at : self._stamp_at + STAMP_DIGITS] = digits
        return bytes(data)

    def decode(self, message: Float64MultiArray) -> tuple[int | None, Array]:
        """Return the stamp of the answered state [ns] or None, and torques in model order (n,).

        Raises:
            InputError: The number of torques is wrong, or one is not finite.
        """
        values = np.array(message.data, dtype=float)
        if values.shape != self._order.shape:
            raise InputError(f"{values.size} numbers for {self._order.size} joints")
        check_finite(values, lambda i: f"number {i}")
        torque = np.empty_like(values)
        torque[self._order] = values
        labels = [dimension.label for dimension in message.layout.dim]
        match = STAMP_PATTERN.fullmatch(labels[0]) if labels else None
        return int(match[1]) if match else None, torque


@dataclass(frozen=True)
class _Output:
    """Command topic of the effort controller of one robot."""

    publisher: Any
    codec: EffortCodec
    joints: slice
    compensates_gravity: bool


class EffortPublishers:
    """Publishers of joint torques to the effort controllers of the robots.

    Robots that compensate gravity themselves receive torque minus gravity. Torques inside this
    package always include gravity, as the limits of the motors do.

    An effort controller holds its last command indefinitely. To leave no motion torque in force,
    the torques fade to gravity alone when states stop, and on shutdown.

    Args:
        node: Controller node.
        team: Robot team.
    """

    def __init__(self, node: ScenarioNode, team: Team) -> None:
        general = node.scenario.general
        self._timeout, self._fade_time = general.state_timeout, general.transition_time
        self._outputs: list[_Output] = []
        for robot, joints in zip(team.robots, team.velocity_slices, strict=True):
            topics = node.scenario.robots[robot.name].topics
            if topics.effort_topic:
                # Only the newest torques may be applied, so the queue holds one message.
                publisher = node.create_publisher(Float64MultiArray, topics.effort_topic, 1)
                codec = EffortCodec(topics.effort_order(list(robot.model.names)[1:]))
                output = _Output(
                    publisher=publisher,
                    codec=codec,
                    joints=joints,
                    compensates_gravity=topics.gravity_compensated,
                )
                self._outputs.append(output)
        self._last: tuple[int, Array, Array] | None = None
        self._sent_at = -np.inf

    def send(self, stamp_ns: int, torque: Array, gravity: Array) -> None:
        """Publish the torques that answer a state.

        Args:
            stamp_ns: Stamp of the state [ns].
            torque: Total torque, shape (n,) [N or N m].
            gravity: Gravity torque contained in it, shape (n,) [N or N m].
        """
        self._last, self._sent_at = (stamp_ns, torque, gravity), time.monotonic()
        self._publish(stamp_ns, torque, gravity)

    def resend(self) -> None:
        """Publish the last torques again."""
        if self._last is not None:
            self._publish(*self._last)

    def fade_to_gravity(self) -> None:
        """Fade the torques to gravity at the last configuration once states have timed out."""
        age = time.monotonic() - self._sent_at
        if self._last is None or age < self._timeout:
            return
        stamp, torque, gravity = self._last
        share = max(0.0, 1.0 - (age - self._timeout) / self._fade_time)
        self._publish(stamp, gravity + share * (torque - gravity), gravity)

    def shut_down(self) -> None:
        """Publish gravity alone and wait until it is acknowledged."""
        if self._last is None:
            return
        stamp, _, gravity = self._last
        self._publish(stamp, gravity, gravity)
        for output in self._outputs:
            output.publisher.wait_for_all_acked(ACK_TIMEOUT)

    def __bool__(self) -> bool:
        """Return True if any robot has its own effort controller."""
        return bool(self._outputs)

    def _publish(self, stamp: int, torque: Array, gravity: Array) -> None:
        for output in self._outputs:
            command = torque[output.joints]
            if output.compensates_gravity:
                command = command - gravity[output.joints]
            output.publisher.publish(output.codec.encode(stamp, command))
