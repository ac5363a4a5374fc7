# SPDX-License-Identifier: Apache-2.0
"""What a person holds in a page, and the dead-man's switch that lets go for them."""

import threading
from dataclasses import dataclass

from noninteract_ros.arrays import Array


@dataclass(frozen=True, slots=True)
class Drag:
    """A handle that is pulled: where it is, seen from where it was taken hold of.

    Attributes:
        subtask: Subtask that is driven.
        element: Place of the element that has the handle.
        grab: Number of the grab; another number means that the handle was let go in between.
        by: Displacement in the world, shape (3,) [m].
        turn: Rotation in the world since then, quaternion x, y, z, w, shape (4,).
    """

    subtask: str
    element: int
    grab: int
    by: Array
    turn: Array


@dataclass(frozen=True, slots=True)
class Push:
    """A pad, stick or key that is held: shares of the largest rates, in world axes.

    Attributes:
        subtask: Subtask that is driven.
        element: Place of the element that is driven.
        linear: Shape (3,), each within -1 and 1.
        angular: Shape (3,), each within -1 and 1.
    """

    subtask: str
    element: int
    linear: Array
    angular: Array


Held = Drag | Push


class DeadMan:
    """Keeps what is held for as long as it is said again and again; used by two threads.

    Args:
        timeout: Silence that lets go [s].
    """

    def __init__(self, timeout: float) -> None:
        self._timeout = timeout
        self._lock = threading.Lock()
        self._held: Held | None = None
        self._said_at = 0.0

    def hold(self, held: Held, now: float) -> None:
        """Somebody holds something, at this time by the monotonic clock [s]."""
        with self._lock:
            self._held, self._said_at = held, now

    def release(self) -> None:
        """Nobody holds anything."""
        with self._lock:
            self._held = None

    def held(self, now: float) -> Held | None:
        """What is held now; once let go by silence, it has to be held anew."""
        with self._lock:
            if self._held is not None and now - self._said_at > self._timeout:
                self._held = None
            return self._held
