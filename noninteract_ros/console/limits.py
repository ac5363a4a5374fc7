# SPDX-License-Identifier: Apache-2.0
"""How much a page may send."""


class RateLimit:
    """Grants messages at a rate, and as many at once as come together in one second.

    Args:
        rate: Messages per second in the long run [Hz].
    """

    def __init__(self, rate: float) -> None:
        self._rate = self._left = rate
        self._at: float | None = None

    def take(self, now: float) -> bool:
        """Whether one more message is granted at this time by the monotonic clock [s]."""
        if self._at is not None:
            self._left = min(self._rate, self._left + (now - self._at) * self._rate)
        self._at = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True
