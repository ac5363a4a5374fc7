# SPDX-License-Identifier: Apache-2.0
"""Input of a subtask: authority, timeout and the resulting desired motion."""

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
    """Configuration of one subtask's input.

    Lists have one number for all coordinates, or as many as those of `ImpedanceSettings`. The
    number of a rotation bounds each component of its rotation vector.
    """

    authority: str = key("Source in authority", "hold", choices=AUTHORITIES, live=True)
    timeout: float = key(
        "Age of the last input after which the subtask holds [s]", 0.5, positive=True
    )
    takeover: str = key(
        "Take-over of a full reference: shaped, a smooth approach from the current desired motion,"
        " or direct, with a jump",
        "shaped",
        choices=("shaped", "direct"),
    )
    hand_over_times: tuple[float, ...] = key(
        "Times of planned hand-overs since the team's first state [s]", (), minimum=0.0
    )
    hand_over_to: tuple[str, ...] = key(
        "Source that receives authority at each of these times", (), choices=AUTHORITIES
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
    priority: int = key(
        "Order of giving way at walls, the highest number first; -1: 0 for relative subtasks,"
        " 2 for postures, 1 for others",
        -1,
        minimum=-1,
    )
    max_wrench: tuple[float, ...] = key("Bound of a force input [N; N m]", (50.0,), positive=True)
    max_wrench_rate: tuple[float, ...] = key(
        "Rate bound of a force input [N/s; N m/s]", (500.0,), positive=True
    )


@dataclass(frozen=True, slots=True)
class SubtaskCommand:
    """Command of a subtask at one tick.

    Attributes:
        reference: Desired motion.
        force: Force input, shape (p,) [N].
        source: Source in authority, or `hold`.
        silent: True if the source in authority has timed out, or has sent nothing yet.
    """

    reference: Reference
    force: Array
    source: str
    silent: bool

    @property
    def leader(self) -> str:
        """Source that leads: the one in authority, or `hold` while it is silent."""
        return "hold" if self.silent else self.source


class SubtaskInput:
    """Sources, authority and desired motion of one subtask.

    Attributes:
        authority: Source in authority; may be changed at any time.
        sources: Inputs by source.
        max_jerk: Jerk bound of shaped motions, shape (p,) [m/s^3; rad/s^3].
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
        """Hold at x, shape (size,), until the source in authority sends an input."""
        self._desired.hold_at(x)
        self._force = np.zeros(self._layout.dim)

    def hold(self, now: float) -> SubtaskCommand:
        """Return the command to hold the desired position, and discard inputs due at `now` [s]."""
        self._consume(now)
        return SubtaskCommand(
            reference=self._desired.now, force=self._force, source="hold", silent=False
        )

    def discard_inputs(self) -> None:
        """Discard all inputs received so far."""
        for source in self.sources.values():
            source.discard_inputs()

    def reset(self) -> None:
        """Reset the sources and the planned hand-overs."""
        self.sources.update({name: Source() for name in SOURCES})
        self._hand_overs.reset()

    def advance(self, now: float, step: float) -> SubtaskCommand:
        """Return the command of this tick.

        Args:
            now: The team's time [s].
            step: Time since the last tick [s].
        """
        self._consume(now)
        source = self.sources.get(self.authority)
        motion = self._fresh(source.motion(now), now) if source else None
        force = self._fresh(source.force(now), now) if source else None
        if force or self._force.any():
            wanted = force[1].force if force else np.zeros_like(self._force)
            self._force = self._shaped(wanted, step)
        reference = self._desired.advance(self._as_of(now, *motion) if motion else None, step)
        silent = source is not None and motion is None and force is None
        return SubtaskCommand(
            reference=reference, force=self._force, source=self.authority, silent=silent
        )

    def _consume(self, now: float) -> None:
        """Apply due hand-overs, and consume due inputs of all sources to bound their queues."""
        self.authority = self._hand_overs.due(now) or self.authority
        for source in self.sources.values():
            source.motion(now)
            source.force(now)

    def _fresh(self, newest: tuple[float, Item] | None, now: float) -> tuple[float, Item] | None:
        """Return an input unless it is older than the timeout."""
        return newest if newest is not None and now - newest[0] <= self._timeout else None

    def _shaped(self, wanted: Array, step: float) -> Array:
        """Return the force input one tick later, within its bounds."""
        bounded = np.clip(wanted, -self._max_force, self._max_force)
        change = self._max_force_rate * step
        return self._force + np.clip(bounded - self._force, -change, change)

    def _as_of(self, now: float, stamp: float, motion: MotionInput) -> MotionInput:
        """Return a motion stamped `stamp`, extrapolated to `now`."""
        if isinstance(motion, Reference):
            return motion.extrapolate(now - stamp, self._layout)
        return motion
