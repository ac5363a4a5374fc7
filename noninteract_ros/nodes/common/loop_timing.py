# SPDX-License-Identifier: Apache-2.0
"""Timing of a loop in wall time: achieved rate, answered share and latency."""

import math
import time
from collections import deque

import numpy as np

from noninteract_ros.clock import seconds
from noninteract_ros.nodes.messages.messages import Level

WINDOW = 4.0  # [s] of answers that are evaluated
RECENT = 1.0  # [s] age of the last answer up to which the answers are evaluated
MIN_ANSWERS = 50  # Fewer answers are not evaluated.
WARN_SHARE, ERROR_SHARE = 0.99, 0.90


class LoopTiming:
    """Answers to states in wall time, over a sliding window.

    Args:
        rate: Rate of the states [Hz].
        max_gap: Difference of stamps beyond which the team was paused or restarted [s].
    """

    def __init__(self, rate: float, max_gap: float) -> None:
        self._rate, self._max_gap = rate, max_gap
        # Periods since the last answer, and latency [s].
        self._answers: deque[tuple[int, float]] = deque(
            maxlen=max(MIN_ANSWERS, int(WINDOW * rate))
        )
        self._last: int | None = None
        self._recorded_at = -math.inf

    def record(self, stamp: int, latency: float) -> None:
        """Record an answer.

        Args:
            stamp: Stamp of the answered state [ns].
            latency: Time from the stamp to the command [s].
        """
        self._recorded_at = time.monotonic()
        gap = 0.0 if self._last is None else seconds(stamp - self._last)
        self._last = stamp
        if 0.0 < gap <= self._max_gap:
            self._answers.append((max(1, round(gap * self._rate)), latency))

    def reset(self) -> None:
        """Discard all answers."""
        self._answers.clear()
        self._last = None

    @property
    def evaluated(self) -> bool:
        """True where there are enough answers, the last one just now: a paused team has none."""
        recent = time.monotonic() - self._recorded_at < RECENT
        return recent and len(self._answers) >= MIN_ANSWERS

    def summary(self) -> tuple[float, float, np.ndarray]:
        """Return achieved rate [Hz], share answered within the period, and latencies [s]."""
        answers = np.array(self._answers)
        periods, latencies = answers.sum(axis=0)[0], answers[:, 1]
        in_time = np.count_nonzero(latencies <= 1.0 / self._rate)
        return self._rate * len(answers) / periods, in_time / periods, latencies

    def values(self) -> dict[str, object]:
        """Return the values for `/diagnostics`."""
        if not self.evaluated:
            return {}
        rate, share, latencies = self.summary()
        median, high = 1e3 * np.percentile(latencies, (50.0, 99.0))
        return {
            "achieved rate [Hz]": float(rate),
            "answered within the period [%]": 100.0 * float(share),
            "state to command, median [ms]": float(median),
            "state to command, 99th percentile [ms]": float(high),
            "state to command, maximum [ms]": 1e3 * float(latencies.max()),
        }

    def problem(self) -> tuple[Level, str]:
        """Return the level and the text of late answers; OK and "" if there are few."""
        if not self.evaluated:
            return Level.OK, ""
        rate, share, _ = self.summary()
        if share >= WARN_SHARE:
            return Level.OK, ""
        level = Level.WARN if share >= ERROR_SHARE else Level.ERROR
        text = f"late: {100.0 * share:.0f} % of the states answered within their period"
        return level, f"{text}, {rate:.0f} of {self._rate:.0f} commands a second"
