# SPDX-License-Identifier: Apache-2.0
"""Parallel execution in processes, where the work is long enough."""

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any, TypeVar

Result = TypeVar("Result")

# Spawn fresh interpreters: a fork would inherit the threads of the caller.
FRESH = multiprocessing.get_context("spawn")


def in_processes(
    function: Callable[..., Result], jobs: Sequence[tuple[Any, ...]], parallel: bool = True
) -> list[Result]:
    """Call a function for each tuple of arguments and return the results in order.

    Args:
        function: Importable function.
        jobs: Arguments of each call.
        parallel: False to run in this process, for short work.
    """
    workers = min(len(jobs), os.cpu_count() or 1)
    if workers < 2 or not parallel:
        return [function(*job) for job in jobs]
    with ProcessPoolExecutor(workers, mp_context=FRESH) as pool:
        running = [pool.submit(function, *job) for job in jobs]
        return [item.result() for item in running]


@contextmanager
def in_background(
    function: Callable[..., Result], job: tuple[Any, ...], parallel: bool = True
) -> Iterator[Callable[[], Result]]:
    """Call a function in another process; yield a function that waits for its result.

    Args:
        function: Importable function.
        job: Its arguments.
        parallel: False to call the function in this process when the result is requested.
    """
    if not parallel or (os.cpu_count() or 1) < 2:
        yield lambda: function(*job)
        return
    with ProcessPoolExecutor(1, mp_context=FRESH) as pool:
        yield pool.submit(function, *job).result
