# SPDX-License-Identifier: Apache-2.0
"""Driver lock: at most one page drives; all other pages are read-only."""

from noninteract_ros.console.held_input import DeadMansSwitch, HeldInput


class DriverLock:
    """Exclusive right of one page to drive; a lost lock releases the held input.

    Args:
        switch: Dead-man's switch of the driver.

    Attributes:
        driver: Number of the page that drives, or None.
    """

    def __init__(self, switch: DeadMansSwitch) -> None:
        self._switch = switch
        self.driver: int | None = None
        self._received_at = 0.0

    def acquire(self, page: int, now: float) -> int | None:
        """Give the lock to a page; return the page that lost it, or None."""
        before, self.driver = self.driver, page
        self._received_at = now
        self._switch.release()
        return before if before != page else None

    def release(self, page: int) -> None:
        """Release the lock if this page has it."""
        if page == self.driver:
            self.driver = None
            self._switch.release()

    def refresh(self, page: int, now: float) -> None:
        """Restart the idle time when the driver has sent a message."""
        if page == self.driver:
            self._received_at = now

    def idle_time(self, now: float) -> float:
        """Return the time since the driver's last message [s]; 0 without a driver."""
        return now - self._received_at if self.driver is not None else 0.0

    def hold_input(self, page: int, held: HeldInput, now: float) -> bool:
        """Hold an input; return False and ignore it if the page is not the driver."""
        if page != self.driver:
            return False
        self._switch.hold(held, now)
        return True

    def release_input(self, page: int) -> None:
        """Release the held input if this page is the driver."""
        if page == self.driver:
            self._switch.release()
