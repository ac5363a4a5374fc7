# SPDX-License-Identifier: Apache-2.0
"""Hand-overs of a subtask between human and autonomy that a scenario plans beforehand."""

from collections.abc import Sequence
from itertools import pairwise

from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import join


class HandOvers:
    """Who is to take a subtask when; each once, so that others may be asked for in between.

    Args:
        times: When, since the team's first state [s]; in wall time its clock began long before.
        takers: Source that takes it, one for each time.
        path: Dotted key of the subtask's block, for error messages.

    Raises:
        ScenarioError: Times do not increase, or there are more or fewer than takers.
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
        """The team's time starts anew."""
        self._done = 0
        self._began: float | None = None

    def due(self, now: float) -> str | None:
        """Who takes the subtask at a time [s]; None where nothing changes."""
        taker = None
        self._began = now if self._began is None else self._began
        passed = now - self._began + 1e-9
        while self._done < len(self._plan) and self._plan[self._done][0] <= passed:
            taker = self._plan[self._done][1]
            self._done += 1
        return taker
