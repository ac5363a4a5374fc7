# SPDX-License-Identifier: Apache-2.0
"""Planned hand-overs of a subtask between human and autonomy."""

from collections.abc import Sequence
from itertools import pairwise

from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import join


class HandOvers:
    """Schedule of hand-overs; each is applied once, so that authority may be changed in between.

    Args:
        times: Times since the team's first state [s]; not absolute, as wall time has another
            origin.
        takers: Source that receives the subtask, one for each time.
        path: Dotted key of the subtask's block, for error messages.

    Raises:
        ScenarioError: Times do not increase, or the numbers of times and takers differ.
    """

    def __init__(self, times: Sequence[float], takers: Sequence[str], path: str) -> None:
        if any(a >= b for a, b in pairwise(times)):
            raise ScenarioError(join(path, "hand_over_times"), list(times), "increasing times")
        if len(times) != len(takers):
            allowed = f"{len(times)} sources, one for each of hand_over_times"
            raise ScenarioError(join(path, "hand_over_to"), list(takers), allowed)
        self._plan = list(zip(times, takers, strict=True))
        self.reset()

    def reset(self) -> None:
        """Reset the schedule; the next time is that of the first state."""
        self._done = 0
        self._start: float | None = None

    def due(self, now: float) -> str | None:
        """Return the source that receives the subtask at a time [s]; None without a hand-over."""
        taker = None
        self._start = now if self._start is None else self._start
        elapsed = now - self._start + 1e-9
        while self._done < len(self._plan) and self._plan[self._done][0] <= elapsed:
            taker = self._plan[self._done][1]
            self._done += 1
        return taker
