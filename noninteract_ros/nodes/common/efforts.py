# SPDX-License-Identifier: Apache-2.0
"""Torques to and from effort controllers, as those of ros2_control take them."""

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

DIGITS = 19
END_TIMEOUT = Duration(seconds=0.2)
LABEL = "state stamp {stamp:0" + str(DIGITS) + "d} ns"
STAMP = re.compile(r"state stamp (\d+) ns")


class EffortCodec:
    """std_msgs/Float64MultiArray with one torque per joint, in the order of an effort controller.

    The label of its dimension says which state it answers. Effort controllers read the data only.

    Args:
        order: Place in the model's order of each number of the message.
    """

    def __init__(self, order: list[int]) -> None:
        self._order = np.array(order, dtype=np.intp)
        count = len(order)
        message = Float64MultiArray(data=[0.0] * count)
        label = LABEL.format(stamp=0)
        message.layout.dim = [MultiArrayDimension(label=label, size=count, stride=count)]
        self._template = CdrTemplate(message)
        self._digits = self._template.encode(np.zeros(count)).index(b"0" * DIGITS)

    def encode(self, stamp_ns: int, torque: Array) -> bytes:
        """Serialized message of torques in the model's order, shape (n,) [N or N m]."""
        data = bytearray(self._template.encode(torque[self._order]))
        data[self._digits : self._digits + DIGITS] = f"{stamp_ns:0{DIGITS}d}".encode()
        return bytes(data)

    def decode(self, message: Float64MultiArray) -> tuple[int | None, Array]:
        """Stamp of the state that is answered [ns], None where it is not told, and the torques.

        Raises:
            InputError: There are more or fewer numbers than joints, or one is not finite.
        """
        values = np.array(message.data, dtype=float)
        if values.shape != self._order.shape:
            raise InputError(f"{values.size} numbers for {self._order.size} joints")
        check_finite(values, lambda i: f"number {i}")
        torque = np.empty_like(values)
        torque[self._order] = values
        labels = [dimension.label for dimension in message.layout.dim]
        told = STAMP.fullmatch(labels[0]) if labels else None
        return int(told[1]) if told else None, torque


@dataclass(frozen=True)
class _Output:
    """One robot's effort controller."""

    publisher: Any
    codec: EffortCodec
    part: slice
    compensated: bool


class EffortOutputs:
    """Tells effort controllers the torques of their robots.

    To robots that compensate gravity by themselves it tells torque minus gravity: torques inside
    this package always hold all of it, as the limits of the motors do.

    An effort controller holds what it was told last, for ever. So that no torque of a motion
    stays in force, the torques go over to gravity alone when states stop, and at the end.

    Args:
        node: The controller's node.
        team: The robots.
    """

    def __init__(self, node: ScenarioNode, team: Team) -> None:
        general = node.scenario.general
        self._silence, self._fade = general.state_timeout, general.transition_time
        self._outputs: list[_Output] = []
        for robot, part in zip(team.robots, team.velocity_slices, strict=True):
            wiring = node.scenario.robots[robot.name].topics
            if wiring.effort_topic:
                # What is not the newest must not be applied, so none is kept.
                publisher = node.create_publisher(Float64MultiArray, wiring.effort_topic, 1)
                codec = EffortCodec(wiring.effort_order(list(robot.model.names)[1:]))
                output = _Output(publisher, codec, part, wiring.gravity_compensated)
                self._outputs.append(output)
        self._last: tuple[int, Array, Array] | None = None
        self._at = -np.inf

    def send(self, stamp_ns: int, torque: Array, gravity: Array) -> None:
        """Tells the torques that answer a state.

        Args:
            stamp_ns: Stamp of the state [ns].
            torque: All of it, shape (n,) [N or N m].
            gravity: What of it holds against gravity, shape (n,) [N or N m].
        """
        self._last, self._at = (stamp_ns, torque, gravity), time.monotonic()
        self._publish(stamp_ns, torque, gravity)

    def repeat(self) -> None:
        """Tells the last torques again."""
        if self._last is not None:
            self._publish(*self._last)

    def rest(self) -> None:
        """Once states have stopped, lets the torques fade to gravity where the robots were."""
        silence = time.monotonic() - self._at
        if self._last is None or silence < self._silence:
            return
        stamp, torque, gravity = self._last
        share = max(0.0, 1.0 - (silence - self._silence) / self._fade)
        self._publish(stamp, gravity + share * (torque - gravity), gravity)

    def end(self) -> None:
        """The last word: gravity alone, waited for until it is heard."""
        if self._last is None:
            return
        stamp, _, gravity = self._last
        self._publish(stamp, gravity, gravity)
        for output in self._outputs:
            output.publisher.wait_for_all_acked(END_TIMEOUT)

    def __bool__(self) -> bool:
        """Whether any robot has an effort controller of its own."""
        return bool(self._outputs)

    def _publish(self, stamp: int, torque: Array, gravity: Array) -> None:
        for output in self._outputs:
            told = torque[output.part]
            told = told - gravity[output.part] if output.compensated else told
            output.publisher.publish(output.codec.encode(stamp, told))
