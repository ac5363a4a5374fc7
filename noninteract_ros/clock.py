# SPDX-License-Identifier: Apache-2.0
"""Times and stamps: one rounding, so that every program computes the same seconds."""


def tick_stamp(tick: int, rate: float) -> int:
    """Stamp of a tick [ns] at a rate [Hz]."""
    return round(tick * 1e9 / rate)


def stamp(seconds: float) -> int:
    """Stamp [ns] of a time [s]."""
    return round(seconds * 1e9)


def seconds(stamp: int) -> float:
    """Time [s] of a stamp [ns]."""
    return stamp / 1e9
