# SPDX-License-Identifier: Apache-2.0
"""Conversion of held page inputs into bounded, continuous references."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.console.held_input import HeldInput, PageDrag, PageTwist
from noninteract_ros.control.references.desired_motion import DesiredMotion
from noninteract_ros.control.references.inputs import MotionInput, Rate, Target
from noninteract_ros.sources.human.input_shaping import Workspace
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference

IDENTITY_ROTATION = np.array([0.0, 0.0, 0.0, 1.0])
AXES = ("x", "y", "z")
FINAL_REFERENCES = 3  # Number of references at rest sent at the end, in case one is lost.


@dataclass(frozen=True)
class DrivableSubtask:
    """Properties of a subtask that an operator can drive.

    Attributes:
        elements: Number of elements.
        axes: Translation axes of each element, in the frame of the subtask.
        rotates: True where each element also has a rotation.
        limits: Bounds of velocity, acceleration and jerk, shape (3, dim).
        linear_speed: Speed at full deflection [m/s].
        angular_speed: Angular speed at full deflection [rad/s].
        workspace: Box that bounds the desired value, or None.
    """

    elements: int
    axes: tuple[str, ...]
    rotates: bool
    limits: Array
    linear_speed: float
    angular_speed: float
    workspace: Workspace | None = None

    @cached_property
    def layout(self) -> Layout:
        """Layout of the values."""
        return Layout([len(self.axes)] * self.elements, [self.rotates] * self.elements)

    def value_slice(self, element: int) -> slice:
        """Return the slice of an element in a value."""
        size = len(self.axes) + 4 * self.rotates
        return slice(element * size, (element + 1) * size)

    def velocity_slice(self, element: int) -> slice:
        """Return the slice of an element in a velocity."""
        dim = len(self.axes) + 3 * self.rotates
        return slice(element * dim, (element + 1) * dim)

    @property
    def axis_indices(self) -> list[int]:
        """Indices of the translation axes in (x, y, z)."""
        return [AXES.index(axis) for axis in self.axes]


@dataclass(frozen=True, slots=True)
class DriveState:
    """State of the team that driving depends on.

    Attributes:
        desired: Last received desired value of each subtask.
        frames: Quaternion of each subtask's frame in the world.
        enabled: Subtasks that the operator may drive now.
    """

    desired: Mapping[str, Array]
    frames: Mapping[str, Array]
    enabled: frozenset[str]


class DrivenMotion:
    """Motion of one subtask while it is driven and until it has come to rest.

    Args:
        subtask: The subtask.
        start: Value that the motion starts from, at rest, shape (size,).
    """

    def __init__(self, subtask: DrivableSubtask, start: Array) -> None:
        self._subtask = subtask
        self._desired = DesiredMotion(subtask.limits, False, subtask.layout)
        self._desired.hold_at(start)
        self._remaining = FINAL_REFERENCES

    @property
    def finished(self) -> bool:
        """True once the motion is at rest and the final references are returned."""
        return self._remaining <= 0

    @property
    def position(self) -> Array:
        """Current desired value, shape (size,)."""
        return self._desired.now.position

    def step(self, held: HeldInput | None, anchor: Array, frame: Array, step: float) -> Reference:
        """Advance the motion by `step` seconds.

        Args:
            held: Input held on this subtask, or None.
            anchor: Value that drags are relative to, shape (size,).
            frame: Quaternion of the subtask's frame in the world.
            step: Time step [s].
        """
        reference = self._desired.advance(self._motion(held, anchor, frame), step)
        moves = reference.velocity.any() or reference.acceleration.any()
        self._remaining = FINAL_REFERENCES if held or moves else self._remaining - 1
        return reference

    def _motion(self, held: HeldInput | None, anchor: Array, frame: Array) -> MotionInput | None:
        box = self._subtask.workspace
        if isinstance(held, PageTwist):
            rate = self._rate(held, frame)
            return Rate(box.limit_velocity(rate, self._desired.now) if box else rate)
        if held is None:
            return None
        target = self._target(held, anchor, frame)
        zero = np.zeros(self._subtask.layout.dim)
        return Target(box.clamp(target) if box else target, zero)

    def _rate(self, held: PageTwist, frame: Array) -> Array:
        subtask, to_frame = self._subtask, so3.matrix(so3.inverse(frame))
        velocity = np.zeros(subtask.layout.dim)
        linear = (subtask.linear_speed * to_frame @ held.linear)[subtask.axis_indices]
        angular = subtask.angular_speed * to_frame @ held.angular
        part = np.concatenate([linear, angular]) if subtask.rotates else linear
        velocity[subtask.velocity_slice(held.element)] = part
        return velocity

    def _target(self, held: PageDrag, anchor: Array, frame: Array) -> Array:
        subtask, to_frame = self._subtask, so3.inverse(frame)
        value, part = anchor.copy(), subtask.value_slice(held.element)
        translation = (so3.matrix(to_frame) @ held.translation)[subtask.axis_indices]
        value[part.start : part.start + len(translation)] += translation
        if subtask.rotates:
            rotation = so3.product(so3.product(to_frame, held.rotation), frame)
            quaternion = slice(part.stop - 4, part.stop)
            value[quaternion] = so3.normalized(so3.product(rotation, value[quaternion]))
        return value


class Drive:
    """All motions that are driven or coming to rest.

    Args:
        subtasks: Drivable subtasks by name.
    """

    def __init__(self, subtasks: Mapping[str, DrivableSubtask]) -> None:
        self._subtasks = subtasks
        self._motions: dict[str, DrivenMotion] = {}
        # Start of the last grab: a drag that resumes after a gap leads to the same target.
        self._grab = -1
        self._anchor: Array = np.zeros(0)

    @property
    def active(self) -> bool:
        """True while a subtask is driven or coming to rest."""
        return bool(self._motions)

    def reset(self) -> None:
        """Discard all motions; the controller brings the team to rest."""
        self._motions.clear()

    def step(self, held: HeldInput | None, state: DriveState, step: float) -> dict[str, Reference]:
        """Advance all motions and return the references to publish, by subtask.

        Args:
            held: Input that the operator holds, or None.
            state: State of the team.
            step: Time since the last call [s].
        """
        for name in [name for name in self._motions if name not in state.enabled]:
            del self._motions[name]
        if (
            held is not None
            and held.subtask in state.enabled
            and held.subtask not in self._motions
        ):
            start = state.desired.get(held.subtask)
            if start is not None:
                self._motions[held.subtask] = DrivenMotion(self._subtasks[held.subtask], start)
        references = {}
        for name, motion in list(self._motions.items()):
            held_here = held if held is not None and held.subtask == name else None
            if held_here is not None and held_here.grab != self._grab:
                self._grab, self._anchor = held_here.grab, motion.position
            frame = state.frames.get(name, IDENTITY_ROTATION)
            references[name] = motion.step(held_here, self._anchor, frame, step)
            if motion.finished:
                del self._motions[name]
        return references
