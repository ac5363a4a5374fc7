# SPDX-License-Identifier: Apache-2.0
"""A difference between two modes that fades out, so that no change has a bump."""

import numpy as np

from noninteract_ros.arrays import Array


class Fade:
    """Adds what was in force before a change, less what is in force after it, for a while."""

    def __init__(self) -> None:
        self._duration = 1.0
        self._difference: Array = np.zeros(0)
        self.reset()

    def reset(self) -> None:
        """End at once."""
        self._start = -np.inf

    def active(self, now: float) -> bool:
        """Whether anything is left of a difference at a time [s]."""
        return now - self._start < self._duration

    def begin(self, now: float, difference: Array, duration: float) -> None:
        """Starts with a difference, shape (n,), at a time [s], for a duration [s]."""
        self._difference, self._start, self._duration = difference, now, duration

    def added_to(self, wanted: Array, now: float) -> Array:
        """With what is left of the difference; after the duration the very same array, (n,)."""
        if not self.active(now):
            return wanted
        progress = (now - self._start) / self._duration
        return wanted + self._difference * (1.0 - progress) ** 2 * (1.0 + 2.0 * progress)
