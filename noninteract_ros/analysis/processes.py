# SPDX-License-Identifier: Apache-2.0
"""Work in several processes, where it is long enough and there are cores for it."""

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any, TypeVar

Result = TypeVar("Result")


def in_processes(
    function: Callable[..., Result], jobs: Sequence[tuple[Any, ...]], worth_it: bool = True
) -> list[Result]:
    """Results of a function, which must be importable, for each tuple of arguments, in order.

    Args:
        function: What to call.
        jobs: Arguments of each call.
        worth_it: Whether the work is long enough to start processes for.
    """
    workers = min(len(jobs), os.cpu_count() or 1)
    if workers < 2 or not worth_it:
        return [function(*job) for job in jobs]
    # A fresh interpreter each: a fork would inherit the threads of whoever asks.
    fresh = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=fresh) as pool:
        running = [pool.submit(function, *job) for job in jobs]
        return [item.result() for item in running]
