# SPDX-License-Identifier: Apache-2.0
"""Whether a state follows from the one before it."""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.team.team import Team

JUMP = 0.1  # [m or rad] a coordinate that is this much further than it can have come was put there


class Continuity:
    """Remembers the last state and says why the next one is a new start.

    Args:
        team: The robots.
        state_timeout: Gap between states that is too long [s].
    """

    def __init__(self, team: Team, state_timeout: float) -> None:
        self._team, self._state_timeout = team, state_timeout
        self._last: tuple[float, Array] | None = None
        self._put_back = False

    def put_back(self) -> None:
        """The next state is where the team was put, however near that is."""
        self._put_back = True

    def forget(self) -> None:
        """The next state is the first one."""
        self._last = None

    def elapsed(self, now: float) -> float:
        """Time since the last state [s]; 0 at the first one."""
        return 0.0 if self._last is None else now - self._last[0]

    def broken(self, now: float, q: Array, v: Array) -> str:
        """Why the state does not follow, or an empty text."""
        if self._last is None:
            return "the first state"
        if self._put_back:
            return "put back to its start"
        last, q_last = self._last
        if now - last > self._state_timeout:
            return f"no state for {now - last:.3f} s"
        moved = np.abs(self._team.difference(q_last, q))
        if (moved > JUMP + 2.0 * np.abs(v) * (now - last)).any():
            joint = self._team.joint_names[int(moved.argmax())]
            return f"{joint} jumped by {moved.max():.3f}"
        return ""

    def note(self, now: float, q: Array) -> None:
        """Takes a state as the last one."""
        self._last, self._put_back = (now, q), False
