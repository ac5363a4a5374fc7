# SPDX-License-Identifier: Apache-2.0
"""Terms that do not change are computed once."""

from collections.abc import Callable
from operator import is_
from typing import Any, Generic, TypeVar

Result = TypeVar("Result")


class Memo(Generic[Result]):
    """A function that keeps its last result while its arguments are the very same objects.

    A team of prismatic joints hands out the same M and the same Jacobians at every state, so what
    follows from them need not be computed again. Nobody may write into such arguments or results.

    Args:
        function: A function without side effects.
    """

    def __init__(self, function: Callable[..., Result]) -> None:
        self._function = function
        self._arguments: tuple[Any, ...] | None = None
        self._result: Result

    def __call__(self, *arguments: Any) -> Result:
        """The result for these arguments."""
        if self._arguments is None or not all(map(is_, self._arguments, arguments)):
            self._result = self._function(*arguments)
            self._arguments = arguments
        return self._result
