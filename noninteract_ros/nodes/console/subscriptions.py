# SPDX-License-Identifier: Apache-2.0
"""What the console hears: the newest message of each topic, taken when a picture needs it."""

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
    """The newest message of one topic as bytes; no executor may know the node.

    Nothing is done for the messages in between: at 1 kHz that is most of them.
    """

    def __init__(self, node: Node, kind: type, topic: str) -> None:
        self._kind = kind
        self._subscription = node.create_subscription(kind, topic, _unused, NEWEST, raw=True)

    def take(self) -> bytes | None:
        """The newest message, if there is one since the last call."""
        newest = None
        handle = self._subscription.handle
        with handle:
            while found := handle.take_message(self._kind, True):
                newest = found[0]
        return newest


class ConsoleSubscriptions:
    """The team as it was last heard of.

    Args:
        node: A node that no executor knows.
        team: The robots.
        stack: Their subtasks.
        bodies: Names of bodies that tell their poses.

    Attributes:
        stamp: Stamp of the newest state [ns]; -1 before the first.
        q: Configuration of the team, shape (nq,).
        state: Value of each subtask, by name.
        desired: Desired value of each subtask, by name.
        bodies: Pose of each body, shape (bodies, 7); NaN where it is not known.
        energy: Named values of each subtask, and of the team under an empty name.
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
        accounts = {"": "energy"} | {name: f"{name}/energy" for name in stack.names}
        self._energy = {
            name: LatestMessage(node, Float64MultiArray, topic) for name, topic in accounts.items()
        }
        self.stamp = -1
        self.q = team.q0
        self.state: dict[str, Array] = {}
        self.desired: dict[str, Array] = {}
        self.bodies = np.full((len(self._body), 7), np.nan)
        self.energy: dict[str, Mapping[str, float]] = {}

    def listen_to_joints(self) -> bool:
        """Takes the newest state; whether there was one. What is malformed is passed over."""
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

    def listen_to_motions(self) -> None:
        """Takes the newest values of subtasks and poses of bodies."""
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

    def listen_to_energies(self) -> None:
        """Takes the newest accounts."""
        for name, topic in self._energy.items():
            data = topic.take()
            if data is not None:
                self.energy[name] = _named(deserialize_message(data, Float64MultiArray))


def _named(message: Any) -> dict[str, float]:
    labels = [dimension.label for dimension in message.layout.dim]
    pairs = zip(labels, message.data, strict=False)
    return {label: value for label, value in pairs if np.isfinite(value)}


def _unused(message: bytes) -> None:
    """Subscriptions must have a callback; no executor ever calls it."""
