# SPDX-License-Identifier: Apache-2.0
"""Schedule of a source: update grid and windows."""

import math

import pytest

from noninteract_ros.sources.schedule import Schedule


def test_next_update_walks_the_grid_without_drift():
    """Each instant n / rate is visited once, also with rounded stamps."""
    for rate in (1000.0, 300.0, 7.0):
        schedule, t = Schedule(rate, [(0.0, math.inf)]), 0.0
        for n in range(1, 2000):
            t = round(schedule.next_update(t) * 1e9) * 1e-9
            assert t == pytest.approx(n / rate, abs=1e-9)
            assert schedule.index(t) == n


@pytest.mark.parametrize("rate", [1000.0, 100.0, 30.0])
def test_next_sample_is_the_first_instant_in_a_window(rate):
    """next_sample returns the first instant inside a window."""
    schedule = Schedule(rate, [(0.5, 1.0), (1.2, 1.201), (1.5, 2.0)])
    inside = [n for n in range(int(3 * rate)) if schedule.window(n) is not None]
    for n in range(int(2.5 * rate)):
        later = [m for m in inside if m > n]
        expected = later[0] / rate if later else math.inf
        assert schedule.next_sample(n / rate) == expected
        assert schedule.next_sample((n + 0.5) / rate) == expected


def test_windows_begin_included_and_end_excluded():
    """An instant on a boundary belongs to the window that starts there."""
    schedule = Schedule(1000.0, [(0.0, 0.3), (0.7, math.inf)])
    assert [schedule.window(n) for n in (0, 299, 300, 699, 700, 10**9)] == [0, 0, None, None, 1, 1]
