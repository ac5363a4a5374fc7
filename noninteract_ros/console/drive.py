# SPDX-License-Identifier: Apache-2.0
"""From what a person holds to references: bounded, without jumps, at rest when they let go."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.console.page_input import Held, PageDrag, PagePush
from noninteract_ros.control.references.desired_motion import DesiredMotion
from noninteract_ros.control.references.inputs import MotionInput, Rate, Target
from noninteract_ros.sources.human.input_shaping import Workspace
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference

NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])
AXES = ("x", "y", "z")
LAST_WORDS = 3  # references at rest before a source falls silent, should one be lost


@dataclass(frozen=True)
class Drivable:
    """A subtask that can be driven.

    Attributes:
        elements: How many elements it has.
        axes: Axes of its frame that each element has.
        rotates: Whether each element has a rotation after them.
        limits: Bounds of velocity, acceleration and jerk, shape (3, dim).
        speed: Rate of a pad pushed to its end [m/s].
        turn_rate: The same of a rotation [rad/s].
        workspace: Box that it can be led to, or None.
    """

    elements: int
    axes: tuple[str, ...]
    rotates: bool
    limits: Array
    speed: float
    turn_rate: float
    workspace: Workspace | None = None

    @cached_property
    def layout(self) -> Layout:
        """Layout of its values."""
        return Layout([len(self.axes)] * self.elements, [self.rotates] * self.elements)

    def value_part(self, element: int) -> slice:
        """Numbers of an element in a value."""
        size = len(self.axes) + 4 * self.rotates
        return slice(element * size, (element + 1) * size)

    def rate_part(self, element: int) -> slice:
        """Numbers of an element in a velocity."""
        dim = len(self.axes) + 3 * self.rotates
        return slice(element * dim, (element + 1) * dim)


@dataclass(frozen=True, slots=True)
class DriveState:
    """What the console knows of the team now.

    Attributes:
        desired: Desired value of each subtask, as last heard.
        frames: Quaternion of the frame that each subtask is seen from.
        led: Subtasks that a human may drive now.
    """

    desired: Mapping[str, Array]
    frames: Mapping[str, Array]
    led: frozenset[str]


class DrivenMotion:
    """The motion of one subtask while it is driven, and until it has come to rest."""

    def __init__(self, subtask: Drivable, start: Array) -> None:
        self._subtask = subtask
        self._desired = DesiredMotion(subtask.limits, False, subtask.layout)
        self._desired.hold_at(start)
        self._words = LAST_WORDS

    @property
    def silent(self) -> bool:
        """Whether it is at rest and has said so."""
        return self._words <= 0

    @property
    def position(self) -> Array:
        """Desired value now."""
        return self._desired.now.position

    def step(self, held: Held | None, anchor: Array, frame: Array, step: float) -> Reference:
        """The reference `step` seconds later; drags lead away from the anchor."""
        reference = self._desired.advance(self._motion(held, anchor, frame), step)
        moves = reference.velocity.any() or reference.acceleration.any()
        self._words = LAST_WORDS if held or moves else self._words - 1
        return reference

    def _motion(self, held: Held | None, anchor: Array, frame: Array) -> MotionInput | None:
        box = self._subtask.workspace
        if isinstance(held, PagePush):
            rate = self._rate(held, frame)
            return Rate(box.limit_velocity(rate, self._desired.now) if box else rate)
        if held is None:
            return None
        target = self._target(held, anchor, frame)
        still = np.zeros(self._subtask.layout.dim)
        return Target(box.clamp(target) if box else target, still)

    def _rate(self, held: PagePush, frame: Array) -> Array:
        subtask, to_frame = self._subtask, so3.matrix(so3.inverse(frame))
        velocity = np.zeros(subtask.layout.dim)
        linear = (subtask.speed * to_frame @ held.linear)[_places(subtask)]
        angular = subtask.turn_rate * to_frame @ held.angular
        part = np.concatenate([linear, angular]) if subtask.rotates else linear
        velocity[subtask.rate_part(held.element)] = part
        return velocity

    def _target(self, held: PageDrag, anchor: Array, frame: Array) -> Array:
        subtask, back = self._subtask, so3.inverse(frame)
        value, part = anchor.copy(), subtask.value_part(held.element)
        by = (so3.matrix(back) @ held.by)[_places(subtask)]
        value[part.start : part.start + len(by)] += by
        if subtask.rotates:
            turn = so3.product(so3.product(back, held.turn), frame)
            rotation = slice(part.stop - 4, part.stop)
            value[rotation] = so3.normalized(so3.product(turn, value[rotation]))
        return value


class Drive:
    """All subtasks that are driven, or coming to rest after it.

    Args:
        subtasks: What can be driven, by name.
    """

    def __init__(self, subtasks: Mapping[str, Drivable]) -> None:
        self._subtasks = subtasks
        self._leads: dict[str, DrivenMotion] = {}
        # Where the last grab began: a drag that goes on after a gap goes to the same place.
        self._grab = -1
        self._anchor: Array = np.zeros(0)

    @property
    def active(self) -> bool:
        """Whether anything is driven or coming to rest."""
        return bool(self._leads)

    def drop(self) -> None:
        """Forgets all motions: the controller brings the team to rest by itself."""
        self._leads.clear()

    def step(self, held: Held | None, scene: DriveState, step: float) -> dict[str, Reference]:
        """References to be said now, by subtask.

        Args:
            held: What a person holds, or None.
            scene: What is known of the team.
            step: Time since the last call [s].
        """
        for name in [name for name in self._leads if name not in scene.led]:
            del self._leads[name]
        if held is not None and held.subtask in scene.led and held.subtask not in self._leads:
            start = scene.desired.get(held.subtask)
            if start is not None:
                self._leads[held.subtask] = DrivenMotion(self._subtasks[held.subtask], start)
        references = {}
        for name, lead in list(self._leads.items()):
            holding = held if held is not None and held.subtask == name else None
            if holding is not None and holding.grab != self._grab:
                self._grab, self._anchor = holding.grab, lead.position
            frame = scene.frames.get(name, NO_TURN)
            references[name] = lead.step(holding, self._anchor, frame, step)
            if lead.silent:
                del self._leads[name]
        return references


def _places(subtask: Drivable) -> list[int]:
    return [AXES.index(axis) for axis in subtask.axes]
