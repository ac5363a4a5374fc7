# SPDX-License-Identifier: Apache-2.0
"""Work in several processes, where it is long enough and there are cores for it."""

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any, TypeVar

Result = TypeVar("Result")

# A fresh interpreter each: a fork would inherit the threads of whoever asks.
FRESH = multiprocessing.get_context("spawn")


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
    with ProcessPoolExecutor(workers, mp_context=FRESH) as pool:
        running = [pool.submit(function, *job) for job in jobs]
        return [item.result() for item in running]


@contextmanager
def beside(
    function: Callable[..., Result], job: tuple[Any, ...], worth_it: bool = True
) -> Iterator[Callable[[], Result]]:
    """Works on a job in another process meanwhile; gives a function that waits for the result.

    Args:
        function: What to call; it must be importable.
        job: Its arguments.
        worth_it: Whether the work is long enough; otherwise it is done when the result is asked.
    """
    if not worth_it or (os.cpu_count() or 1) < 2:
        yield lambda: function(*job)
        return
    with ProcessPoolExecutor(1, mp_context=FRESH) as pool:
        yield pool.submit(function, *job).result
