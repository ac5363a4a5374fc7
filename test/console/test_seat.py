# SPDX-License-Identifier: Apache-2.0
"""The dead-man's switch, the driver's seat, and how much a page may send."""

from dataclasses import replace

import numpy as np

from noninteract_ros.console.driver_lock import DriverLock
from noninteract_ros.console.limits import RateLimit
from noninteract_ros.console.page_input import PageDeadMan, PagePush

HELD = PagePush("cooperative", 0, 7, np.ones(3), np.zeros(3))


def test_silence_lets_go() -> None:
    """What is not said again within the timeout is let go; a page that stutters goes on."""
    switch = PageDeadMan(0.2)
    switch.hold(HELD, 1.0)
    assert switch.held(1.2) is not None
    assert switch.held(1.201) is None
    switch.hold(HELD, 1.9)
    assert switch.held(2.0) is not None


def test_after_a_long_silence_it_has_to_be_held_anew() -> None:
    """The same grab counts no more, however often it is said; another one does."""
    switch = PageDeadMan(0.2)
    switch.hold(HELD, 1.0)
    for now in (2.1, 2.2, 2.3):
        switch.hold(HELD, now)
        assert switch.held(now) is None
    switch.hold(replace(HELD, grab=8), 2.4)
    assert switch.held(2.4) is not None


def test_a_grab_has_a_number_of_its_own() -> None:
    """After a release the same page number is another grab, be it another page's."""
    switch = PageDeadMan(0.2)
    grabs = []
    for now in (1.0, 1.1, 1.2):
        switch.hold(HELD, now)
        held = switch.held(now)
        assert held is not None
        grabs.append(held.grab)
        if now == 1.1:
            switch.release()
    assert grabs[0] == grabs[1] != grabs[2]


def test_only_the_driver_holds() -> None:
    """What other pages hold has no effect, and neither has their letting go."""
    switch = PageDeadMan(0.2)
    seat = DriverLock(switch)
    assert not seat.hold(1, HELD, 0.0)
    assert switch.held(0.0) is None
    seat.take(1, 0.0)
    assert seat.hold(1, HELD, 0.0)
    seat.release(2)
    assert switch.held(0.0) is not None
    seat.release(1)
    assert switch.held(0.0) is None


def test_whoever_loses_the_seat_lets_go() -> None:
    """Taking over, leaving and being closed all release what was held."""
    switch = PageDeadMan(0.2)
    seat = DriverLock(switch)
    seat.take(1, 0.0)
    seat.hold(1, HELD, 0.0)
    assert seat.take(2, 0.0) == 1
    assert switch.held(0.0) is None
    assert not seat.hold(1, HELD, 0.0)
    seat.hold(2, HELD, 0.0)
    seat.leave(1)
    assert switch.held(0.0) is not None
    seat.leave(2)
    assert switch.held(0.0) is None
    assert seat.driver is None


def test_a_silent_driver_is_noticed() -> None:
    """Silence counts from the driver's last word; others' words do not count."""
    seat = DriverLock(PageDeadMan(0.2))
    assert seat.silence(100.0) == 0.0
    seat.take(1, 0.0)
    seat.heard(1, 3.0)
    seat.heard(2, 9.0)
    assert seat.silence(10.0) == 7.0


def test_an_allowance_bounds_rate_and_burst() -> None:
    """In the long run so many a second, at once no more than that."""
    allowance = RateLimit(50.0)
    assert sum(allowance.take(0.0) for _ in range(200)) == 50
    granted = sum(allowance.take(0.01 * k) for k in range(1, 1001))
    assert granted in (499, 500)
