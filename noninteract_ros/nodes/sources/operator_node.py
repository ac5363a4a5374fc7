# SPDX-License-Identifier: Apache-2.0
"""Base class of the nodes for input devices of a human."""

import time
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped
from trajectory_msgs.msg import MultiDOFJointTrajectory

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.impedance import per_coordinate
from noninteract_ros.errors import InputError, ScenarioError, one_of
from noninteract_ros.nodes.common.guarded_node import LOOP_QOS
from noninteract_ros.nodes.common.node import ScenarioNode
from noninteract_ros.nodes.messages.messages import (
    AXES,
    WORLD,
    Level,
    ParsedReference,
    SubtaskCodec,
)
from noninteract_ros.sources.human.input_settings import OperatorSettings
from noninteract_ros.sources.human.input_shaping import DeadManSwitch, OperatorInput
from noninteract_ros.subtasks.reference import Reference
from noninteract_ros.subtasks.subtask import Subtask

BOUNDS = ("max_velocity", "max_acceleration", "max_jerk")
RELEASE_MESSAGES = 5  # zero rates published on release, in case some are lost
DESIRED_TIMEOUT = 0.5  # [s] age from which the desired motion is not used


class OperatorNode(ScenarioNode):
    """Node that commands a subtask as its human source while the device is held.

    It runs in wall time. On release it publishes a few zero rates and then nothing, which leaves
    the subtask to another device. Messages have no stamp, so they take effect when the controller
    receives them.

    Args:
        name: Name of the node.
        kwargs: Arguments of `rclpy.node.Node`.

    Raises:
        ScenarioError: The subtask of the operator does not exist, has several elements, or does
            not fit the workspace.
    """

    def __init__(self, name: str, **kwargs: Any) -> None:
        super().__init__(name, **kwargs)
        self.settings = self.scenario.operator or OperatorSettings()
        subtask = self.settings.subtask
        stack = self.scenario.stack
        if subtask not in stack.names:
            raise ScenarioError("operator.subtask", repr(subtask), one_of(stack.names, subtask))
        task = stack.subtasks[stack.names.index(subtask)]
        settings = self.scenario.subtasks[subtask].input
        limits = np.array([per_coordinate(task, name, getattr(settings, name)) for name in BOUNDS])
        self.input = OperatorInput(self.settings, task, limits)
        self.dead_man = DeadManSwitch(self.settings.hold_timeout)
        self._codec = SubtaskCodec(subtask, task.elements, task.axes, task.rotates)
        self._operator_codec = OperatorCodec(task)
        self._desired: bytes | None = None
        self._desired_received_at = -np.inf
        self._releases_left = self._sent = 0
        self._rate_publisher = self.create_publisher(
            TwistStamped, f"{subtask}/human/target_twist", LOOP_QOS
        )
        self._target_publisher = self.create_publisher(
            PoseStamped, f"{subtask}/human/target_pose", LOOP_QOS
        )
        self.subscribe(MultiDOFJointTrajectory, f"{subtask}/desired", self._on_desired, raw=True)
        self.create_wall_timer(1.0 / self.settings.update_rate, self._on_timer)

    @property
    def has_loop(self) -> bool:
        """False, since timers do all work in wall time, in lockstep too."""
        return False

    def _on_desired(self, data: bytes) -> None:
        self._desired, self._desired_received_at = data, time.monotonic()

    def desired(self) -> Reference | None:
        """Return the desired motion of the subtask, or None if it is unknown."""
        if self._desired is None or time.monotonic() - self._desired_received_at > DESIRED_TIMEOUT:
            return None
        found = self._codec.decode(self._desired)
        if not isinstance(found, ParsedReference):
            return None
        zeros = np.zeros(self._codec.layout.dim)
        velocity = zeros if found.velocity is None else found.velocity
        acceleration = zeros if found.acceleration is None else found.acceleration
        return Reference(found.position, velocity, acceleration)

    def _on_timer(self) -> None:
        now = time.monotonic()
        desired = self.desired() if self.dead_man.is_held(now) else None
        if desired is not None:
            try:
                self.command(now, desired)
                self._releases_left = RELEASE_MESSAGES
                self._sent += 1
                return
            except InputError as error:
                self.reject_input("the device", str(error))
        self.release()
        if self._releases_left > 0:
            self._releases_left -= 1
            self.publish_rate(np.zeros(self._codec.layout.dim))

    def command(self, now: float, desired: Reference) -> None:
        """Publish the command of the device while it is held.

        Args:
            now: Monotonic time [s].
            desired: Desired motion of the subtask.
        """
        raise NotImplementedError

    def release(self) -> None:
        """Reset the state of the held device."""

    def publish_rate(self, velocity: Array) -> None:
        """Publish a rate, shape (p,)."""
        self._rate_publisher.publish(self._operator_codec.rate(velocity))

    def publish_target(self, value: Array) -> None:
        """Publish a set-point, shape (size,)."""
        self._target_publisher.publish(self._operator_codec.target(value))

    def status(self) -> tuple[Level, str, dict[str, object]]:
        """Return the state of the device, and a warning without a desired motion."""
        held = self.dead_man.is_held(time.monotonic())
        values: dict[str, object] = {
            "subtask": self.settings.subtask,
            "messages sent": self._sent,
            "held": held,
        }
        if self.desired() is None:
            return Level.WARN, "waiting for the desired motion from the controller", values
        return Level.OK, "held" if held else "released", values


class OperatorCodec:
    """Rates and set-points as messages, for a subtask with one element.

    The messages have no stamp.

    Args:
        task: Subtask.
    """

    def __init__(self, task: Subtask) -> None:
        axes = [AXES.index(axis) for axis in task.axes]
        self._in_pose = axes + ([3, 4, 5, 6] if task.rotates else [])
        self._in_twist = axes + ([3, 4, 5] if task.rotates else [])

    def rate(self, velocity: Array) -> TwistStamped:
        """Return the message of a rate, shape (p,)."""
        values = np.zeros(6)
        values[self._in_twist] = velocity
        message = TwistStamped()
        message.header.frame_id = WORLD
        linear, angular = message.twist.linear, message.twist.angular
        linear.x, linear.y, linear.z, angular.x, angular.y, angular.z = values.tolist()
        return message

    def target(self, value: Array) -> PoseStamped:
        """Return the message of a set-point, shape (size,)."""
        values = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        values[self._in_pose] = value
        message = PoseStamped()
        message.header.frame_id = WORLD
        p, q = message.pose.position, message.pose.orientation
        p.x, p.y, p.z, q.x, q.y, q.z, q.w = values.tolist()
        return message
