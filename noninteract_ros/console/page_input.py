# SPDX-License-Identifier: Apache-2.0
"""What a person holds in a page, and the dead-man's switch that lets go for them."""

import threading
from dataclasses import dataclass, replace

from noninteract_ros.arrays import Array

FORGIVEN = 1.0  # [s] of silence after which what was held has to be held anew


@dataclass(frozen=True, slots=True)
class PageDrag:
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
class PagePush:
    """A pad, stick or key that is held: shares of the largest rates, in world axes.

    Attributes:
        subtask: Subtask that is driven.
        element: Place of the element that is driven.
        grab: Number of the grab.
        linear: Shape (3,), each within -1 and 1.
        angular: Shape (3,), each within -1 and 1.
    """

    subtask: str
    element: int
    grab: int
    linear: Array
    angular: Array


Held = PageDrag | PagePush


class PageDeadMan:
    """Keeps what is held for as long as it is said again and again; used by two threads.

    A page that stutters goes on with what it held. After a longer silence nobody knows any more
    what the person wants: then it has to be let go and held anew.

    Args:
        timeout: Silence that lets go [s].
    """

    def __init__(self, timeout: float) -> None:
        self._timeout = timeout
        self._lock = threading.Lock()
        self._held: Held | None = None
        self._grab = self._grabs = 0
        self._said_at = 0.0

    def hold(self, held: Held, now: float) -> None:
        """Somebody holds something, at this time by the monotonic clock [s].

        What is kept has a number of its own as its grab: pages number theirs as they like.
        """
        with self._lock:
            if self._held is None or held.grab != self._grab:
                self._grabs += 1
            elif now - self._said_at > FORGIVEN:
                return
            self._grab, self._said_at = held.grab, now
            self._held = replace(held, grab=self._grabs)

    def release(self) -> None:
        """Nobody holds anything."""
        with self._lock:
            self._held = None

    def held(self, now: float) -> Held | None:
        """What is held now."""
        with self._lock:
            return self._held if now - self._said_at <= self._timeout else None
