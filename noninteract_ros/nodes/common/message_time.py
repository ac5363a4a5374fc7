# SPDX-License-Identifier: Apache-2.0
"""Time of messages: the one place that decides which stamps are accepted."""

import time
from collections.abc import Callable

from noninteract_ros.clock import seconds
from noninteract_ros.errors import InputError

RESTART_SILENCE = 1.0  # [s] wall time without messages after which an earlier stamp is a restart
ROUNDING = 2e-9  # [s] of stamps in whole nanoseconds
MAX_READING_TIME = 0.005  # [s] within which both clocks are read
MIN_JUMP = 0.02  # [s] smallest reported jump of a clock
JUMP_REPORT_TIME = 10.0  # [s] for which a jump is reported


class StampChecker:
    """Age, lead and order of stamps per topic.

    Stamps are compared with the time of the robots: in wall time the clock of the node, in
    lockstep the stamp of the newest state. Rejected stamps have no effect on those after them.
    After `RESTART_SILENCE` without messages on a topic, its stamps may go back.

    Args:
        now: Return the time of the robots [ns], or None while it is unknown.
        max_lead: Largest accepted lead of a stamp over that time [s].
        max_age: Largest accepted age of a stamp [s].
    """

    def __init__(
        self, now: Callable[[], int | None], max_lead: float, max_age: float = float("inf")
    ) -> None:
        self._now, self._max_lead, self._max_age = now, max_lead, max_age
        self._lockstep = max_age == float("inf")
        self._last: dict[str, tuple[int, float]] = {}

    def last(self, topic: str) -> int:
        """Return the newest accepted stamp of a topic [ns], or -1 if there is none."""
        return self._last.get(topic, (-1, 0.0))[0]

    def silence(self, topic: str) -> float:
        """Return the wall time since the last accepted message of a topic [s]."""
        return time.monotonic() - self._last.get(topic, (-1, -float("inf")))[1]

    def check(
        self,
        topic: str,
        stamp: int,
        *,
        max_lead: float | None = None,
        max_age: float | None = None,
    ) -> bool:
        """Check the age, the lead and the order of a stamp.

        Args:
            topic: Topic of the message.
            stamp: Stamp [ns].
            max_lead: Largest accepted lead [s]; by default that of the checker.
            max_age: Largest accepted age [s]; by default that of the checker.

        Returns:
            True if the topic has restarted with an earlier stamp.

        Raises:
            InputError: The stamp is too old, too far ahead, or goes back.
        """
        self.check_age(stamp, max_lead=max_lead, max_age=max_age)
        if stamp >= self.last(topic):
            return False
        if self.silence(topic) >= RESTART_SILENCE:
            return True
        text = f"stamp goes back: {seconds(stamp):.6f} s after {seconds(self.last(topic)):.6f} s"
        raise InputError(text)

    def check_age(
        self, stamp: int, *, max_lead: float | None = None, max_age: float | None = None
    ) -> None:
        """Check the age and the lead of a stamp; see `check`."""
        now = self._now()
        if now is None:
            return
        lead = seconds(stamp - now)
        lead_bound = self._max_lead if max_lead is None else max_lead
        age_bound = self._max_age if max_age is None else max_age
        if lead > lead_bound:
            text = f"is {lead:.6g} s ahead, allowed: {lead_bound:.3g} s"
            raise InputError(f"stamp {seconds(stamp):.6f} s {text}")
        if -lead > age_bound:
            text = f"is {-lead:.6g} s old, allowed: {age_bound:.3g} s"
            raise InputError(f"stamp {seconds(stamp):.6f} s {text}")

    def record(self, topic: str, stamp: int) -> None:
        """Record the stamp [ns] of an accepted message."""
        self._last[topic] = (stamp, time.monotonic())

    def accept(self, topic: str, stamp: int, **bounds: float | None) -> bool:
        """Check a stamp and record it; see `check`."""
        restarted = self.check(topic, stamp, **bounds)
        self.record(topic, stamp)
        return restarted

    def accept_state(self, topic: str, stamp: int) -> bool:
        """Check the stamp of a state and record it; see `check`.

        In lockstep a silence also permits stamps far ahead, since the team may have been led by
        another program meanwhile.
        """
        lead = float("inf") if self._lockstep and self.silence(topic) >= RESTART_SILENCE else None
        return self.accept(topic, stamp, max_lead=lead)

    def discard(self, topic: str) -> None:
        """Discard the stamp of a topic."""
        self._last.pop(topic, None)

    def reset(self) -> None:
        """Discard the stamps of all topics."""
        self._last.clear()


class ClockMonitor:
    """Jumps of the clock of a node against the monotonic clock.

    Args:
        now: Return the time of the clock [ns].
    """

    def __init__(self, now: Callable[[], int]) -> None:
        self._now = now
        self._offset: int | None = None
        self._jump, self._jumped_at = 0.0, -float("inf")

    def update(self) -> None:
        """Compare the clocks."""
        before = time.monotonic_ns()
        now = self._now()
        after = time.monotonic_ns()
        if after - before > 1e9 * MAX_READING_TIME:
            return  # The program was paused in between.
        offset = now - before
        if self._offset is not None and abs(offset - self._offset) > 1e9 * MIN_JUMP:
            self._jump, self._jumped_at = seconds(offset - self._offset), time.monotonic()
        self._offset = offset

    def problem(self) -> str:
        """Return the text of a jump within the last `JUMP_REPORT_TIME`, or ""."""
        if time.monotonic() - self._jumped_at > JUMP_REPORT_TIME:
            return ""
        direction = "ahead" if self._jump > 0.0 else "back"
        return f"the clock has jumped {direction} by {abs(self._jump):.3g} s"
