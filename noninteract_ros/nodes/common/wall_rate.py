# SPDX-License-Identifier: Apache-2.0
"""Rate of a loop in wall time."""

import time


class WallRate:
    """Rate in wall time [Hz]. Missed periods are skipped.

    Attributes:
        missed: Number of missed periods.
    """

    def __init__(self, rate: float) -> None:
        self._period = 1.0 / rate
        self._next = time.monotonic()
        self.missed = 0

    def sleep(self) -> None:
        """Sleep until the next period begins."""
        self._next += self._period
        now = time.monotonic()
        if self._next > now:
            time.sleep(self._next - now)
        elif now - self._next > self._period:
            skipped = int((now - self._next) / self._period)
            self.missed += skipped
            self._next += skipped * self._period
