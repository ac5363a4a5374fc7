# SPDX-License-Identifier: Apache-2.0
"""How the gauntlet's inner loops are compiled."""

from collections.abc import Callable
from typing import Any

from numba import config, njit

# Vectors of four or six numbers gain nothing from it, and compiling takes half as long again.
config.LOOP_VECTORIZE = 0
config.SLP_VECTORIZE = 0


def compiled(function: Callable[..., Any]) -> Any:
    """Compiles a function at its first call; it lets other threads run, and divides as NumPy."""
    return njit(function, nogil=True, error_model="numpy", _nrt=False)
