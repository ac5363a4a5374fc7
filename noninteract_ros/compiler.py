# SPDX-License-Identifier: Apache-2.0
"""Compilation of functions by numba, cached on disk until their sources change."""

import hashlib
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np

Function = TypeVar("Function", bound=Callable[..., Any])
FIRST = cast(int, np.intp(0))  # A literal would compile another specialisation.


@cache
def _source_digest(folder: Path) -> bytes:
    """Return the digest of a folder's sources, whose functions call each other across files."""
    digest = hashlib.sha256()
    for file in sorted(folder.glob("*.py")):
        digest.update(file.read_bytes())
    return digest.digest()


def compiled(function: Function) -> Function:
    """Compile a function at its first call with each combination of argument types; cache that.

    Arithmetic follows IEEE 754 strictly: nothing is reordered or contracted, and a division by
    zero gives inf or NaN, as in numpy. The cache lies beside the source or in the user's cache
    folder; without a writable folder, or on a full disk, each process compiles anew.
    """
    return _cached(numba.njit(error_model="numpy", no_cfunc_wrapper=True)(function))


def inner(function: Function) -> Function:
    """Compile a function without an entry point from Python, which halves the compile time."""
    options = {"no_cfunc_wrapper": True, "no_cpython_wrapper": True}
    return _cached(numba.njit(error_model="numpy", **options)(function))


def _cached(kernel: Any) -> Any:
    """Enable the cache of a function, invalidated by a change of any source in its folder.

    By default, numba checks the function's own file only, and would keep code that calls changed
    functions of other files.
    """
    if numba.config.DISABLE_JIT:
        return kernel  # The Python function itself.
    try:
        kernel.enable_caching()
    except (RuntimeError, OSError):
        return kernel
    folder = Path(kernel.py_func.__code__.co_filename).parent
    kernel._cache._cache_file._source_stamp = _source_digest(folder)
    save = kernel._cache.save_overload

    def save_if_possible(*arguments: Any) -> None:
        """Save machine code; a full or failing disk costs the next start its time, no more."""
        with suppress(OSError):
            save(*arguments)

    kernel._cache.save_overload = save_if_possible
    return kernel
