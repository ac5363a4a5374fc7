# SPDX-License-Identifier: Apache-2.0
"""Continuity of the states of a team."""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.team.team import Team

JUMP = 0.1  # [m or rad] of a coordinate beyond what its speed explains


class Continuity:
    """Compares each state with the last one.

    Args:
        team: The robots.
        state_timeout: Gap between states that is too long [s].
    """

    def __init__(self, team: Team, state_timeout: float) -> None:
        self._team, self._state_timeout = team, state_timeout
        self._last: tuple[float, Array] | None = None
        self._interrupted = False

    def interrupt(self) -> None:
        """Have the next state begin anew, however near it is: the team's state was reset."""
        self._interrupted = True

    def reset(self) -> None:
        """Have the next state be the first one."""
        self._last = None

    def elapsed(self, now: float) -> float:
        """Return the time since the last state [s]; 0 at the first one."""
        return 0.0 if self._last is None else now - self._last[0]

    def broken(self, now: float, q: Array, v: Array) -> str:
        """Return why a state does not follow from the last one, or ""."""
        if self._last is None:
            return "the first state"
        if self._interrupted:
            return "put back to its start"
        last, q_last = self._last
        if now - last > self._state_timeout:
            return f"no state for {now - last:.3f} s"
        moved = np.abs(self._team.difference(q_last, q))
        if (moved > JUMP + 2.0 * np.abs(v) * (now - last)).any():
            joint = self._team.joint_names[int(moved.argmax())]
            return f"{joint} jumped by {moved.max():.3f}"
        return ""

    def record(self, now: float, q: Array) -> None:
        """Store a state as the last one."""
        self._last, self._interrupted = (now, q), False
