# SPDX-License-Identifier: Apache-2.0
"""Inputs of human and autonomous sources to a subtask."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import InputError
from noninteract_ros.subtasks.reference import Reference

SOURCES = ("human", "autonomy")
HORIZON = 1.0  # [s] largest lead of an input's stamp over the team's time


@dataclass(frozen=True, slots=True)
class Target:
    """Set-point to reach within the subtask's limits.

    Attributes:
        position: Goal value, shape (size,) [m; quaternions].
        velocity: Velocity at the goal, shape (p,) [m/s; rad/s].
    """

    position: Array
    velocity: Array


@dataclass(frozen=True, slots=True)
class Rate:
    """Velocity to reach within the subtask's limits, shape (p,) [m/s; rad/s]."""

    velocity: Array


@dataclass(frozen=True, slots=True)
class Force:
    """Force input tau~_c (remark 1), shape (p,) [N; N m]."""

    force: Array


MotionInput = Reference | Target | Rate


class Source:
    """Inputs of one source to one subtask, in the order of their stamps.

    Attributes:
        complete_until: Time up to which all inputs of the source were received [s].
    """

    def __init__(self) -> None:
        self.complete_until = -np.inf
        self._motions: deque[tuple[float, MotionInput]] = deque()
        self._forces: deque[tuple[float, Force]] = deque()
        self._motion: tuple[float, MotionInput] | None = None
        self._force: tuple[float, Force] | None = None

    def receive(self, stamp: float, item: MotionInput | Force, now: float) -> None:
        """Store an input that is valid from `stamp` on.

        Args:
            stamp: Stamp of the input [s].
            item: Input.
            now: The team's time [s].

        Raises:
            InputError: The stamp decreases, or is too far ahead of `now`.
        """
        if isinstance(item, Force):
            self._append(self._forces, self._force, stamp, item, now)
        else:
            self._append(self._motions, self._motion, stamp, item, now)
            self.complete_until = max(self.complete_until, stamp)

    @staticmethod
    def _append(
        queue: deque, taken: tuple[float, object] | None, stamp: float, item: object, now: float
    ) -> None:
        last = queue[-1] if queue else taken
        if last is not None and stamp < last[0]:
            raise InputError(f"stamp goes back: {stamp:.6f} s after {last[0]:.6f} s")
        if stamp > now + HORIZON:
            raise InputError(f"stamp {stamp:.6f} s is ahead of the team's time {now:.6f} s")
        queue.append((stamp, item))

    def mark_complete_until(self, stamp: float) -> None:
        """Record that the source has no further input up to `stamp` [s]."""
        self.complete_until = max(self.complete_until, stamp)

    def discard_inputs(self) -> None:
        """Discard all inputs received so far."""
        self._motions.clear()
        self._forces.clear()
        self._motion = self._force = None

    def motion(self, now: float) -> tuple[float, MotionInput] | None:
        """Return the newest motion whose stamp has been reached, with the stamp."""
        while self._motions and self._motions[0][0] <= now:
            self._motion = self._motions.popleft()
        return self._motion

    def force(self, now: float) -> tuple[float, Force] | None:
        """Return the newest force whose stamp has been reached, with the stamp."""
        while self._forces and self._forces[0][0] <= now:
            self._force = self._forces.popleft()
        return self._force
