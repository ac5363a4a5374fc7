# SPDX-License-Identifier: Apache-2.0
"""Inputs that an operator holds in a page, and the dead-man's switch that releases them."""

import threading
from dataclasses import dataclass, replace

from noninteract_ros.arrays import Array

REGRAB_TIMEOUT = 1.0  # [s] of silence after which an input has to be grabbed again


@dataclass(frozen=True, slots=True)
class PageDrag:
    """Displacement of a dragged handle since it was grabbed.

    Attributes:
        subtask: Name of the driven subtask.
        element: Index of the driven element.
        grab: Number of the grab; it changes when the handle is released in between.
        translation: Displacement in the world frame, shape (3,) [m].
        rotation: Rotation in the world frame, quaternion x, y, z, w, shape (4,).
    """

    subtask: str
    element: int
    grab: int
    translation: Array
    rotation: Array


@dataclass(frozen=True, slots=True)
class PageTwist:
    """Deflection of a pad, stick or key as a normalized twist in the world frame.

    Attributes:
        subtask: Name of the driven subtask.
        element: Index of the driven element.
        grab: Number of the grab.
        linear: Share of the linear speed, shape (3,), each in [-1, 1].
        angular: Share of the angular speed, shape (3,), each in [-1, 1].
    """

    subtask: str
    element: int
    grab: int
    linear: Array
    angular: Array


HeldInput = PageDrag | PageTwist


class DeadMansSwitch:
    """Input that is held only as long as the page keeps sending it; safe for two threads.

    A page that stutters resumes its input. After `REGRAB_TIMEOUT` the operator's intent is
    unknown: the input has to be released and grabbed again.

    Args:
        timeout: Silence after which the input is released [s].
    """

    def __init__(self, timeout: float) -> None:
        self._timeout = timeout
        self._lock = threading.Lock()
        self._held: HeldInput | None = None
        self._grab = self._grabs = 0
        self._received_at = 0.0

    def hold(self, held: HeldInput, now: float) -> None:
        """Store an input that is held at this time of the monotonic clock [s].

        The grab gets a new number, because pages choose theirs independently.
        """
        with self._lock:
            if self._held is None or held.grab != self._grab:
                self._grabs += 1
            elif now - self._received_at > REGRAB_TIMEOUT:
                return
            self._grab, self._received_at = held.grab, now
            self._held = replace(held, grab=self._grabs)

    def release(self) -> None:
        """Release the held input."""
        with self._lock:
            self._held = None

    def held(self, now: float) -> HeldInput | None:
        """Return the input held at this time, or None."""
        with self._lock:
            return self._held if now - self._received_at <= self._timeout else None
