# SPDX-License-Identifier: Apache-2.0
"""Fading difference between two modes, so that no change has a bump."""

import numpy as np

from noninteract_ros.arrays import Array


class Fade:
    """Adds a difference, of before a change less after it, that fades out."""

    def __init__(self) -> None:
        self._duration = 1.0
        self._difference: Array = np.zeros(0)
        self.reset()

    def reset(self) -> None:
        """End at once."""
        self._start = -np.inf

    def active(self, now: float) -> bool:
        """Return True while anything is left of a difference at a time [s]."""
        return now - self._start < self._duration

    def begin(self, now: float, difference: Array, duration: float) -> None:
        """Start with a difference, shape (n,), at a time [s], for a duration [s]."""
        self._difference, self._start, self._duration = difference, now, duration

    def added_to(self, wanted: Array, now: float) -> Array:
        """Return a value with what is left of the difference, (n,); later the same array."""
        if not self.active(now):
            return wanted
        progress = (now - self._start) / self._duration
        return wanted + self._difference * (1.0 - progress) ** 2 * (1.0 + 2.0 * progress)
