# SPDX-License-Identifier: Apache-2.0
"""Subscriptions of the console: newest message of each topic, taken on demand."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import MultiDOFJointTrajectory

from noninteract_ros.arrays import Array
from noninteract_ros.errors import InputError
from noninteract_ros.nodes.messages import messages
from noninteract_ros.nodes.messages.cdr import JointStateCodec
from noninteract_ros.nodes.messages.messages import Marker, SubtaskCodec
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team

NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


class LatestMessage:
    """Newest serialized message of one topic.

    Older messages are discarded without deserialization: at 1 kHz that is most of them.

    Args:
        node: Node without an executor.
        message_type: Type of the messages.
        topic: Name of the topic.
    """

    def __init__(self, node: Node, message_type: type, topic: str) -> None:
        self._type = message_type
        self._subscription = node.create_subscription(
            message_type, topic, _unused, NEWEST, raw=True
        )

    def take(self) -> bytes | None:
        """Return the newest message since the last call, or None."""
        newest = None
        handle = self._subscription.handle
        with handle:
            while found := handle.take_message(self._type, True):
                newest = found[0]
        return newest


class ConsoleSubscriptions:
    """Last received state of the team.

    Args:
        node: Node without an executor.
        team: The robots.
        stack: The subtasks.
        bodies: Names of the bodies that publish their poses.

    Attributes:
        stamp: Stamp of the newest state [ns]; -1 before the first.
        q: Configuration of the team, shape (nq,).
        state: Measured value of each subtask, by name.
        desired: Desired value of each subtask, by name.
        bodies: Pose of each body, shape (bodies, 7); NaN before the first message.
        energy: Labelled energies of each subtask, and of the team under an empty name.
    """

    def __init__(self, node: Node, team: Team, stack: SubtaskStack, bodies: Iterable[str]) -> None:
        self._team, self._node = team, node
        self._joints = JointStateCodec(team.joint_names)
        self._joint_states = LatestMessage(node, JointState, "joint_states")
        self._codecs = {
            task.name: SubtaskCodec(task.name, task.elements, task.axes, task.rotates)
            for task in stack.subtasks
        }
        motion = MultiDOFJointTrajectory
        self._state = {name: LatestMessage(node, motion, f"{name}/state") for name in stack.names}
        self._desired = {
            name: LatestMessage(node, motion, f"{name}/desired") for name in stack.names
        }
        self._body = [LatestMessage(node, PoseStamped, f"{name}/pose") for name in bodies]
        energy_topics = {"": "energy"} | {name: f"{name}/energy" for name in stack.names}
        self._energy = {
            name: LatestMessage(node, Float64MultiArray, topic)
            for name, topic in energy_topics.items()
        }
        self.stamp = -1
        self.q = team.q0
        self.state: dict[str, Array] = {}
        self.desired: dict[str, Array] = {}
        self.bodies = np.full((len(self._body), 7), np.nan)
        self.energy: dict[str, Mapping[str, float]] = {}

    def update_state(self) -> bool:
        """Read the newest joint state; return False if there is none or it is malformed."""
        data = self._joint_states.take()
        if data is None:
            return False
        try:
            stamp, positions, _, _ = self._joints.decode(data)
        except InputError:
            return False
        if positions is None:
            return False
        self.stamp, self.q = stamp, self._team.configuration_from_joints(positions)
        return True

    def update_motions(self) -> None:
        """Read the newest values of all subtasks and poses of all bodies."""
        for topics, values in ((self._state, self.state), (self._desired, self.desired)):
            for name, topic in topics.items():
                data = topic.take()
                if data is not None and (value := self._value(name, data)) is not None:
                    values[name] = value
        for row, topic in zip(self.bodies, self._body, strict=True):
            data = topic.take()
            if data is not None:
                pose = deserialize_message(data, PoseStamped).pose
                row[:] = messages.flat(pose.position, pose.orientation)

    def _value(self, name: str, data: bytes) -> Array | None:
        try:
            parsed = self._codecs[name].decode(data)
        except InputError:
            return None
        return None if isinstance(parsed, Marker) else parsed.position

    def update_energies(self) -> None:
        """Read the newest energies."""
        for name, topic in self._energy.items():
            data = topic.take()
            if data is not None:
                self.energy[name] = _labelled(deserialize_message(data, Float64MultiArray))


def _labelled(message: Any) -> dict[str, float]:
    labels = [dimension.label for dimension in message.layout.dim]
    pairs = zip(labels, message.data, strict=False)
    return {label: value for label, value in pairs if np.isfinite(value)}


def _unused(message: bytes) -> None:
    """Satisfy the subscription, which requires a callback; no executor calls it."""
