# SPDX-License-Identifier: Apache-2.0
"""Supervision of the loop in wall time: divergent rates and implausible states."""

import time
from collections import deque

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.controller import TeamController
from noninteract_ros.control.stability.loop_guard import LoopGuard
from noninteract_ros.nodes.common.loop_timing import LoopTiming
from noninteract_ros.scenario import Scenario
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team

SLOW_SHARE = 0.9  # of the rate, above which the check of the gains at the nominal rate holds
RECOVERY_SHARE = 0.8  # of the measured rate, at which the loop must be stable to end a hold
RECOVERY_TIME = 2.0  # [s] of stable rates that ends a hold
MAX_COORDINATES = 100  # Eigenvalues of larger teams would block the other services.
JUMP = 0.1  # [m or rad] beyond the motion at twice the velocity limit
MAX_JUMPS, JUMP_WINDOW = 3, 5.0  # Jumps within this time [s] that stop the team


class LoopSupervision:
    """Hold of a team whose loop is too slow for its law and gains; detection of state jumps.

    Args:
        scenario: Scenario.
        core: Controller.
        timing: Timing of the loop.

    Attributes:
        overload: Reason why the team is held, or "".
    """

    def __init__(self, scenario: Scenario, core: TeamController, timing: LoopTiming) -> None:
        self._core, self._timing = core, timing
        self._rate = scenario.general.rate
        self.overload = ""
        self._stable_since: float | None = None
        self._last: tuple[float, Array] | None = None
        self._jumps: deque[float] = deque(maxlen=MAX_JUMPS)
        self._max_speed = core.team.velocity_limits
        self._team: Team | None = None
        self._stack: SubtaskStack | None = None
        if (
            core.team.n <= MAX_COORDINATES
        ):  # Data of its own, since another thread uses the core's.
            self._team = core.team.with_own_data()
            self._stack = scenario.build_stack(self._team)

    def check_rate(self, q: Array) -> None:
        """Update `overload` from the measured rate and latency at a configuration, shape (nq,)."""
        if self._team is None or self._stack is None or not self._timing.evaluated:
            return
        achieved, _, latencies = self._timing.summary()
        # A delayed torque is bounded by one that is held longer.
        late = max(0.0, float(np.median(latencies)) - 1.0 / self._rate)
        rate = 1.0 / (1.0 / achieved + late)
        share = RECOVERY_SHARE if self.overload else 1.0
        divergence = ""
        if rate < SLOW_SHARE * self._rate:
            guard = LoopGuard(self._team, self._stack, share * rate)
            divergence = guard.divergence(q, self._core.mode.law, self._core.mode.impedance)
        now = time.monotonic()
        if divergence:
            self.overload = (
                f"the loop is too slow, {rate:.0f} of {self._rate:.0f} Hz: {divergence}"
            )
            self._stable_since = None
        elif self.overload:
            self._stable_since = self._stable_since or now
            if now - self._stable_since >= RECOVERY_TIME:
                self.overload, self._stable_since = "", None

    def jumps_repeatedly(self, now: float, q: Array, restarted: str) -> str:
        """Return the reason to stop the team for repeated jumps of the states, or "".

        Args:
            now: Stamp of the state [s].
            q: Configuration, shape (nq,).
            restarted: Reason why the controller has restarted at this state, or "".
        """
        last, self._last = self._last, (now, q)
        if last is None:
            return ""
        moved = np.abs(self._core.team.difference(last[1], q))
        excess = moved - JUMP - 2.0 * self._max_speed * (now - last[0])
        if not (excess > 0.0).any() and "jumped" not in restarted:
            return ""
        self._jumps.append(now)
        if len(self._jumps) < MAX_JUMPS or now - self._jumps[0] > JUMP_WINDOW:
            return ""
        joint = self._core.team.joint_names[int(moved.argmax())]
        return f"states jump repeatedly, {joint} by {moved.max():.3g}"

    def reset(self) -> None:
        """Discard the last state and its jumps, as after a reset of the team."""
        self._last = None
        self._jumps.clear()
