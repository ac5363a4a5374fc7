# SPDX-License-Identifier: Apache-2.0
"""Program `pose_operator`: set-points from the pose of a haptic device or tracker."""

import math
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import Joy
from std_msgs.msg import Bool

from noninteract_ros.arrays import Array
from noninteract_ros.errors import InputError, ScenarioError
from noninteract_ros.nodes.common.program import run_program
from noninteract_ros.nodes.messages.cdr import check_finite
from noninteract_ros.nodes.messages.messages import POSE, check_rotations, flat
from noninteract_ros.nodes.sources.operator_node import OperatorNode
from noninteract_ros.sources.human.input_settings import TrackerSettings
from noninteract_ros.sources.human.input_shaping import DeadManSwitch
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference


class PoseOperator(OperatorNode):
    """Node that commands set-points while the clutch is held.

    The subtask starts from its current value and moves by the motion of the device. The clutch is
    released when the device times out, or when its pose jumps. A clutch on a Joy topic is also
    released when that topic times out, since drivers repeat pressed buttons. A clutch on a Bool
    topic is held until a message releases it.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("pose_operator", **kwargs)
        settings = self.scenario.tracker or TrackerSettings()
        self._max_jump, self._max_turn = settings.largest_jump, settings.largest_turn
        self._mounting = _mounting(settings)
        self._button = settings.clutch_button
        self._clutch, self._pressed = False, DeadManSwitch(self.settings.hold_timeout)
        self._pose: Array | None = None
        self.subscribe(PoseStamped, settings.pose_topic, self._on_pose)
        if settings.clutch_topic:
            self.subscribe(Bool, settings.clutch_topic, self._on_clutch)
        if settings.joy_topic:
            self.subscribe(Joy, settings.joy_topic, self._on_joy)

    def _on_clutch(self, message: Bool) -> None:
        self._clutch = message.data

    def _on_joy(self, message: Joy) -> None:
        exists = len(message.buttons) > self._button
        self._pressed.update(time.monotonic(), exists and bool(message.buttons[self._button]))

    def _on_pose(self, message: PoseStamped) -> None:
        pose = flat(message.pose.position, message.pose.orientation)
        check_finite(pose, POSE.__getitem__)
        check_rotations(pose[None, 3:], ("the device",))
        turned = so3.product(self._mounting, so3.normalized(pose[3:]))
        pose = np.concatenate(
            [
                so3.matrix(self._mounting) @ pose[:3],
                so3.product(turned, so3.inverse(self._mounting)),
            ]
        )
        before, self._pose = self._pose, pose
        now = time.monotonic()
        held = self._clutch or self._pressed.is_held(now)
        if before is not None and self.dead_man.is_held(now):
            jump = float(np.linalg.norm(pose[:3] - before[:3]))
            if jump > self._max_jump:
                self.dead_man.release()
                raise InputError(f"the pose jumped by {jump:.3g} m: clutch released")
            turn = 2.0 * math.acos(min(1.0, abs(float(pose[3:] @ before[3:]))))
            if turn > self._max_turn:
                self.dead_man.release()
                raise InputError(f"the pose turned by {turn:.3g} rad at once: clutch released")
        self.dead_man.update(now, held)

    def command(self, now: float, desired: Reference) -> None:
        """Publish the set-point moved by the motion of the device since it was clutched."""
        assert self._pose is not None  # The clutch is not held without a pose.
        if not self.input.clutched:
            self.input.engage(self._pose, desired.position)
        self.publish_target(self.input.target(self._pose))

    def release(self) -> None:
        """Release the clutch."""
        self.input.release()


def _mounting(settings: TrackerSettings) -> Array:
    found = list(settings.mounting)
    try:
        if len(found) != 4:
            raise InputError(f"{len(found)} numbers")
        return Layout((0,), (True,)).checked(np.array(found))
    except InputError as error:
        allowed = f"a unit quaternion x, y, z, w ({error})"
        raise ScenarioError("tracker.mounting", found, allowed) from error


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program."""
    return run_program(PoseOperator, arguments)
