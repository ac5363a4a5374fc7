# SPDX-License-Identifier: Apache-2.0
"""Rates and set-points of people's devices as messages, for a subtask of one element."""

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped

from noninteract_ros.arrays import Array
from noninteract_ros.nodes.messages.messages import AXES, WORLD
from noninteract_ros.subtasks.subtask import Subtask


class OperatorCodec:
    """Messages without a stamp: they hold from when they are heard.

    Args:
        task: The subtask that they lead.
    """

    def __init__(self, task: Subtask) -> None:
        places = [AXES.index(axis) for axis in task.axes]
        self._in_pose = places + ([3, 4, 5, 6] if task.rotates else [])
        self._in_twist = places + ([3, 4, 5] if task.rotates else [])

    def rate(self, velocity: Array) -> TwistStamped:
        """Message with a rate, shape (p,)."""
        values = np.zeros(6)
        values[self._in_twist] = velocity
        message = TwistStamped()
        message.header.frame_id = WORLD
        linear, angular = message.twist.linear, message.twist.angular
        linear.x, linear.y, linear.z, angular.x, angular.y, angular.z = values.tolist()
        return message

    def target(self, value: Array) -> PoseStamped:
        """Message with a set-point, shape (size,)."""
        values = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        values[self._in_pose] = value
        message = PoseStamped()
        message.header.frame_id = WORLD
        place, turn = message.pose.position, message.pose.orientation
        place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w = values.tolist()
        return message
