# SPDX-License-Identifier: Apache-2.0
"""Waiting for something to happen, with a deadline and witnesses."""

import time
from collections.abc import Callable
from typing import Any

DEADLINE = 30.0  # [s] for anything to happen
WITNESSES: list[Callable[[], list[str]]] = []  # Asked for lines where something does not happen.


def until(done: Callable[[], Any], what: str | Callable[[], str] = "") -> Any:
    """Polls until something is true; what it was, then.

    Where it does not come true, the error has what the programs said and printed last.

    Args:
        done: What is to be true.
        what: Its name; a callable where the name tells of a state, for it is asked at the end.
    """
    end = time.monotonic() + DEADLINE
    while not (value := done()):
        if time.monotonic() > end:
            told = [f"not within {DEADLINE:.0f} s: {what() if callable(what) else what}"]
            raise AssertionError("\n".join(told + [line for tell in WITNESSES for line in tell()]))
        time.sleep(0.002)
    return value
