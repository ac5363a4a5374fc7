# SPDX-License-Identifier: Apache-2.0
"""Schedule of a source of references: instants of an update grid inside time windows."""

import math
from collections.abc import Iterable

TOLERANCE = 1e-3
"""Largest distance from the grid, as a share of the update period, that counts as on it."""


class Schedule:
    """Update instants n / rate, n = 0, 1, …, inside windows.

    Window bounds are rounded up to the grid.

    Args:
        rate: Update rate [Hz].
        windows: Pairs (begin, end) [s] in order of time; `end` is excluded and may be infinite.
    """

    def __init__(self, rate: float, windows: Iterable[tuple[float, float]]) -> None:
        self.rate = rate
        bounds = ((self._first_from(begin), self._first_from(end)) for begin, end in windows)
        self._windows = [(begin, end) for begin, end in bounds if begin < end]

    def _first_from(self, t: float) -> float:
        return math.ceil(t * self.rate - TOLERANCE) if t < math.inf else math.inf

    def index(self, t: float) -> int:
        """Return the number of the update instant nearest to `t` [s]."""
        return round(t * self.rate)

    def window(self, index: int) -> int | None:
        """Return the number of the window around an update instant; None outside all windows."""
        for number, (begin, end) in enumerate(self._windows):
            if begin <= index < end:
                return number
        return None

    def next_update(self, t: float) -> float:
        """Return the first update instant after `t` [s], inside a window or not."""
        return (math.floor(t * self.rate + TOLERANCE) + 1) / self.rate

    def next_sample(self, t: float) -> float:
        """Return the first instant after `t` inside a window [s]; infinity if there is none."""
        following = math.floor(t * self.rate + TOLERANCE) + 1
        for begin, end in self._windows:
            if following < end:
                return max(following, begin) / self.rate
        return math.inf
