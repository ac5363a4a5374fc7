# SPDX-License-Identifier: Apache-2.0
"""When a source of references speaks: the instants of its update grid inside its windows."""

import math
from collections.abc import Iterable

TOLERANCE = 1e-3
"""Share of an update period within which a time counts as an instant of the grid."""


class Schedule:
    """Update instants n / rate, n = 0, 1, …, of which those inside a window are spoken at."""

    def __init__(self, rate: float, windows: Iterable[tuple[float, float]]) -> None:
        """Rounds the windows up to the grid.

        Args:
            rate: Update rate [Hz].
            windows: Pairs (begin, end) [s] in order of time, `end` excluded and possibly infinite.
        """
        self.rate = rate
        bounds = ((self._first_from(begin), self._first_from(end)) for begin, end in windows)
        self._windows = [(begin, end) for begin, end in bounds if begin < end]

    def _first_from(self, t: float) -> float:
        return math.ceil(t * self.rate - TOLERANCE) if t < math.inf else math.inf

    def index(self, t: float) -> int:
        """Number of the update instant nearest to `t` [s]."""
        return round(t * self.rate)

    def window(self, index: int) -> int | None:
        """Number of the window that holds an update instant; None where the source is silent."""
        for number, (begin, end) in enumerate(self._windows):
            if begin <= index < end:
                return number
        return None

    def next_update(self, t: float) -> float:
        """The first update instant later than `t` [s], spoken or not."""
        return (math.floor(t * self.rate + TOLERANCE) + 1) / self.rate

    def silent_until(self, t: float) -> float:
        """The first spoken instant later than `t` [s]; infinity if there is none."""
        following = math.floor(t * self.rate + TOLERANCE) + 1
        for begin, end in self._windows:
            if following < end:
                return max(following, begin) / self.rate
        return math.inf
