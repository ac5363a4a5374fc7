# SPDX-License-Identifier: Apache-2.0
"""Compilation of functions to machine code, kept until their sources change."""

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np

Function = TypeVar("Function", bound=Callable[..., Any])
FIRST = cast(int, np.intp(0))  # A literal would have functions compiled once more.


@cache
def _source_digest(folder: Path) -> bytes:
    """Digest of all sources of a folder: its functions call each other across files."""
    digest = hashlib.sha256()
    for file in sorted(folder.glob("*.py")):
        digest.update(file.read_bytes())
    return digest.digest()


def compiled(function: Function) -> Function:
    """Compiles a function for the arguments that it first meets, and keeps the machine code.

    Arithmetic is IEEE's to the letter: nothing is reordered or contracted, and a division by zero
    gives inf or NaN, as numpy's does. The code is kept where numba finds a place, beside the
    source or in the user's cache; where there is none, each process compiles anew.
    """
    return _cached(numba.njit(error_model="numpy", no_cfunc_wrapper=True)(function))


def inner(function: Function) -> Function:
    """The same for functions that only compiled ones call, which saves half the time for them."""
    options = {"no_cfunc_wrapper": True, "no_cpython_wrapper": True}
    return _cached(numba.njit(error_model="numpy", **options)(function))


def _cached(kernel: Any) -> Any:
    """The function with its machine code kept until any source in its folder changes.

    numba alone looks at the function's own file, and would go on with what has changed elsewhere.
    """
    if numba.config.DISABLE_JIT:
        return kernel  # It is the Python function itself.
    try:
        kernel.enable_caching()
    except RuntimeError:
        return kernel
    folder = Path(kernel.py_func.__code__.co_filename).parent
    kernel._cache._cache_file._source_stamp = _source_digest(folder)
    return kernel
