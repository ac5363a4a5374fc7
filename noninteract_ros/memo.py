# SPDX-License-Identifier: Apache-2.0
"""Cache for terms that stay constant between calls."""

from collections.abc import Callable
from operator import is_
from typing import Any, Generic, TypeVar

Result = TypeVar("Result")


class Memo(Generic[Result]):
    """Function wrapper that returns its last result while the arguments are the same objects.

    A team of prismatic joints returns the same M and the same Jacobians at every state, so terms
    derived from them need not be computed again. Arguments and results must not be modified.

    Args:
        function: Function without side effects.
    """

    def __init__(self, function: Callable[..., Result]) -> None:
        self._function = function
        self._arguments: tuple[Any, ...] | None = None
        self._result: Result

    def __call__(self, *arguments: Any) -> Result:
        """Return the result for these arguments, computed only if one of them is a new object."""
        if self._arguments is None or not all(map(is_, self._arguments, arguments)):
            self._result = self._function(*arguments)
            self._arguments = arguments
        return self._result
