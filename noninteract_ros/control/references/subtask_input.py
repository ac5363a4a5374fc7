# SPDX-License-Identifier: Apache-2.0
"""Who leads a subtask: authority, silence and the desired motion that results."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.fast.compiled_layout import CompiledLayout
from noninteract_ros.control.law.impedance import per_coordinate
from noninteract_ros.control.references.desired_motion import DesiredMotion
from noninteract_ros.control.references.hand_over import HandOvers
from noninteract_ros.control.references.inputs import SOURCES, MotionInput, Source
from noninteract_ros.schema import key
from noninteract_ros.subtasks.reference import Reference
from noninteract_ros.subtasks.subtask import Subtask

AUTHORITIES = (*SOURCES, "hold")
Item = TypeVar("Item")


@dataclass(frozen=True)
class InputSettings:
    """Configuration of how one subtask is led.

    Lists have one number for all, or as `ImpedanceSettings` has them. A rotation's number bounds
    each component of its rotation vector.
    """

    authority: str = key("Source in force", "hold", choices=AUTHORITIES, live=True)
    timeout: float = key("Silence after which the subtask holds [s]", 0.5, positive=True)
    takeover: str = key(
        "How a full reference is taken over: shaped from where the desired motion is, or direct,"
        " with the jump it brings",
        "shaped",
        choices=("shaped", "direct"),
    )
    hand_over_times: tuple[float, ...] = key(
        "When the subtask is handed over, since the team's first state [s]", (), minimum=0.0
    )
    hand_over_to: tuple[str, ...] = key(
        "Who takes it at each of these times", (), choices=AUTHORITIES
    )
    max_velocity: tuple[float, ...] = key(
        "Velocity bound of shaped motions [m/s; rad/s]", (1.0,), positive=True
    )
    max_acceleration: tuple[float, ...] = key(
        "Acceleration bound of shaped motions [m/s^2; rad/s^2]", (5.0,), positive=True
    )
    max_jerk: tuple[float, ...] = key(
        "Jerk bound of shaped motions [m/s^3; rad/s^3]", (50.0,), positive=True
    )
    max_wrench: tuple[float, ...] = key("Bound of a force input [N; N m]", (50.0,), positive=True)
    max_wrench_rate: tuple[float, ...] = key(
        "Rate bound of a force input [N/s; N m/s]", (500.0,), positive=True
    )


@dataclass(frozen=True, slots=True)
class SubtaskCommand:
    """What a subtask is asked to do at one tick.

    Attributes:
        reference: Desired motion.
        force: Force input in force, shape (p,) [N].
        source: Source that is followed, or `hold`.
        silent: Whether the source in force has gone silent, or never spoke.
    """

    reference: Reference
    force: Array
    source: str
    silent: bool

    @property
    def leader(self) -> str:
        """Who leads in fact: one that is silent only holds."""
        return "hold" if self.silent else self.source


class SubtaskInput:
    """Sources, authority and desired motion of one subtask.

    Attributes:
        authority: Source in force; may be changed at any time.
        sources: Inputs by source.
        max_jerk: Bound of shaped motions, shape (p,) [m/s^3; rad/s^3].
    """

    def __init__(self, subtask: Subtask, settings: InputSettings) -> None:
        self.authority = settings.authority
        self.sources = {name: Source() for name in SOURCES}
        plan = settings.hand_over_times, settings.hand_over_to
        self._hand_overs = HandOvers(*plan, subtask.name)
        self._timeout = settings.timeout
        names = ("max_velocity", "max_acceleration", "max_jerk")
        limits = np.array(
            [per_coordinate(subtask, name, getattr(settings, name)) for name in names]
        )
        self.max_jerk: Array = limits[2]
        self._layout = CompiledLayout(subtask.layout)
        self._desired = DesiredMotion(limits, settings.takeover == "direct", self._layout)
        self._max_force = per_coordinate(subtask, "max_wrench", settings.max_wrench)
        self._max_force_rate = per_coordinate(subtask, "max_wrench_rate", settings.max_wrench_rate)
        self._force: Array = np.zeros(subtask.dim)

    def hold_at(self, x: Array) -> None:
        """Holds at x, shape (size,), until the source in force speaks again."""
        self._desired.hold_at(x)
        self._force = np.zeros(self._layout.dim)

    def hold(self, now: float) -> SubtaskCommand:
        """At rest where it is, whatever the sources say up to `now` [s]."""
        self._take(now)
        return SubtaskCommand(self._desired.now, self._force, "hold", False)

    def discard_inputs(self) -> None:
        """Drops every input that has come so far."""
        for source in self.sources.values():
            source.discard_inputs()

    def reset(self) -> None:
        """Starts anew with sources that have never spoken."""
        self.sources.update({name: Source() for name in SOURCES})
        self._hand_overs.reset()

    def advance(self, now: float, step: float) -> SubtaskCommand:
        """What to do at this tick.

        Args:
            now: The team's time [s].
            step: Time since the last tick [s].
        """
        self._take(now)
        source = self.sources.get(self.authority)
        motion = self._fresh(source.motion(now), now) if source else None
        force = self._fresh(source.force(now), now) if source else None
        if force or self._force.any():
            wanted = force[1].force if force else np.zeros_like(self._force)
            self._force = self._shaped(wanted, step)
        reference = self._desired.advance(self._as_of(now, *motion) if motion else None, step)
        silent = source is not None and motion is None and force is None
        return SubtaskCommand(reference, self._force, self.authority, silent)

    def _take(self, now: float) -> None:
        """Takes what has come due, so that no input piles up, of whatever source."""
        self.authority = self._hand_overs.due(now) or self.authority
        for source in self.sources.values():
            source.motion(now)
            source.force(now)

    def _fresh(self, newest: tuple[float, Item] | None, now: float) -> tuple[float, Item] | None:
        """An input that is not older than the timeout."""
        return newest if newest is not None and now - newest[0] <= self._timeout else None

    def _shaped(self, wanted: Array, step: float) -> Array:
        """The force input one tick later, within its bounds."""
        bounded = np.clip(wanted, -self._max_force, self._max_force)
        change = self._max_force_rate * step
        return self._force + np.clip(bounded - self._force, -change, change)

    def _as_of(self, now: float, stamp: float, motion: MotionInput) -> MotionInput:
        """What a motion that was given for `stamp` asks for now."""
        if isinstance(motion, Reference):
            return motion.extrapolate(now - stamp, self._layout)
        return motion
