# SPDX-License-Identifier: Apache-2.0
"""Waiting for a condition with a deadline."""

import time
from collections.abc import Callable
from typing import Any

DEADLINE = 30.0  # [s] for any condition
REPORTS: list[Callable[[], list[str]]] = []  # Lines appended to the error of a missed deadline.


def until(done: Callable[[], Any], what: str | Callable[[], str] = "") -> Any:
    """Poll a condition until it is true, and return its value.

    The error of a missed deadline has the last status and output of the programs.

    Args:
        done: Condition.
        what: Name of the condition; a callable is evaluated at the deadline.
    """
    end = time.monotonic() + DEADLINE
    while not (value := done()):
        if time.monotonic() > end:
            lines = [f"not within {DEADLINE:.0f} s: {what() if callable(what) else what}"]
            raise AssertionError("\n".join(lines + [line for get in REPORTS for line in get()]))
        time.sleep(0.002)
    return value
