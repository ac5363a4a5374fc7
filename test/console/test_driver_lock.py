# SPDX-License-Identifier: Apache-2.0
"""Dead-man's switch, driver lock and rate limit."""

from dataclasses import replace

import numpy as np

from noninteract_ros.console.driver_lock import DriverLock
from noninteract_ros.console.held_input import DeadMansSwitch, PageTwist
from noninteract_ros.console.site import RateLimit

HELD = PageTwist(subtask="cooperative", element=0, grab=7, linear=np.ones(3), angular=np.zeros(3))


def test_silence_releases_the_input() -> None:
    """An input that is not repeated within the timeout is released; a stutter resumes it."""
    switch = DeadMansSwitch(0.2)
    switch.hold(HELD, 1.0)
    assert switch.held(1.2) is not None
    assert switch.held(1.201) is None
    switch.hold(HELD, 1.9)
    assert switch.held(2.0) is not None


def test_a_long_silence_requires_a_new_grab() -> None:
    """The same grab is ignored, however often it is sent; a new one is accepted."""
    switch = DeadMansSwitch(0.2)
    switch.hold(HELD, 1.0)
    for now in (2.1, 2.2, 2.3):
        switch.hold(HELD, now)
        assert switch.held(now) is None
    switch.hold(replace(HELD, grab=8), 2.4)
    assert switch.held(2.4) is not None


def test_grabs_are_numbered_by_the_switch() -> None:
    """After a release, an input with the same number counts as a new grab."""
    switch = DeadMansSwitch(0.2)
    grabs = []
    for now in (1.0, 1.1, 1.2):
        switch.hold(HELD, now)
        held = switch.held(now)
        assert held is not None
        grabs.append(held.grab)
        if now == 1.1:
            switch.release()
    assert grabs[0] == grabs[1] != grabs[2]


def test_only_the_driver_holds_inputs() -> None:
    """Inputs and releases of other pages have no effect."""
    switch = DeadMansSwitch(0.2)
    lock = DriverLock(switch)
    assert not lock.hold_input(1, HELD, 0.0)
    assert switch.held(0.0) is None
    lock.acquire(1, 0.0)
    assert lock.hold_input(1, HELD, 0.0)
    lock.release_input(2)
    assert switch.held(0.0) is not None
    lock.release_input(1)
    assert switch.held(0.0) is None


def test_losing_the_lock_releases_the_input() -> None:
    """Taking over and releasing control both release the held input."""
    switch = DeadMansSwitch(0.2)
    lock = DriverLock(switch)
    lock.acquire(1, 0.0)
    lock.hold_input(1, HELD, 0.0)
    assert lock.acquire(2, 0.0) == 1
    assert switch.held(0.0) is None
    assert not lock.hold_input(1, HELD, 0.0)
    lock.hold_input(2, HELD, 0.0)
    lock.release(1)
    assert switch.held(0.0) is not None
    lock.release(2)
    assert switch.held(0.0) is None
    assert lock.driver is None


def test_the_idle_time_counts_from_the_drivers_last_message() -> None:
    """Messages of other pages do not restart the idle time."""
    lock = DriverLock(DeadMansSwitch(0.2))
    assert lock.idle_time(100.0) == 0.0
    lock.acquire(1, 0.0)
    lock.refresh(1, 3.0)
    lock.refresh(2, 9.0)
    assert lock.idle_time(10.0) == 7.0


def test_the_rate_limit_bounds_rate_and_burst() -> None:
    """In the long run `rate` messages per second, and at most as many at once."""
    rate_limit = RateLimit(50.0)
    assert sum(rate_limit.accept(0.0) for _ in range(200)) == 50
    accepted = sum(rate_limit.accept(0.01 * k) for k in range(1, 1001))
    assert accepted in (499, 500)
