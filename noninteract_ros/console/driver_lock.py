# SPDX-License-Identifier: Apache-2.0
"""Who drives: one page at a time; all others watch."""

from noninteract_ros.console.page_input import Held, PageDeadMan


class DriverLock:
    """The driver's seat; whoever leaves it, or is made to, lets go.

    Args:
        switch: The dead-man's switch that goes with it.

    Attributes:
        driver: Number of the page that drives, or None.
    """

    def __init__(self, switch: PageDeadMan) -> None:
        self._switch = switch
        self.driver: int | None = None
        self._heard_at = 0.0

    def take(self, page: int, now: float) -> int | None:
        """Seats a page, whoever sat there before; that page, or None."""
        before, self.driver = self.driver, page
        self._heard_at = now
        self._switch.release()
        return before if before != page else None

    def leave(self, page: int) -> None:
        """A page leaves, if it was the driver."""
        if page == self.driver:
            self.driver = None
            self._switch.release()

    def heard(self, page: int, now: float) -> None:
        """A page has said something."""
        if page == self.driver:
            self._heard_at = now

    def silence(self, now: float) -> float:
        """How long the driver has been silent [s]; 0 without one."""
        return now - self._heard_at if self.driver is not None else 0.0

    def hold(self, page: int, held: Held, now: float) -> bool:
        """The driver holds something; whether the page is the driver."""
        if page != self.driver:
            return False
        self._switch.hold(held, now)
        return True

    def release(self, page: int) -> None:
        """The driver holds nothing."""
        if page == self.driver:
            self._switch.release()
