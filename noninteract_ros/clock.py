# SPDX-License-Identifier: Apache-2.0
"""Conversion between times and stamps, with one rounding for all programs."""


def tick_stamp(tick: int, rate: float) -> int:
    """Return the stamp [ns] of a tick at a rate [Hz]."""
    return round(tick * 1e9 / rate)


def stamp(seconds: float) -> int:
    """Return the stamp [ns] of a time [s]."""
    return round(seconds * 1e9)


def seconds(stamp: int) -> float:
    """Return the time [s] of a stamp [ns]."""
    return stamp / 1e9
