# SPDX-License-Identifier: Apache-2.0
"""The product's own energy account, compiled.

Nothing of its arithmetic is written a second time: the functions of `control.energy.tank` are
compiled as they stand. A change of the account is a change of what the gauntlet judges.
"""

from types import FunctionType
from typing import Any

from noninteract_ros.control.energy import tank as product
from noninteract_ros.validation.gauntlet.arrays import compiled

_space: dict[str, Any] = dict(vars(product))


def _compile(function: Any) -> Any:
    """Compile one of the account's functions; what it calls must have been compiled before."""
    kernel = compiled(FunctionType(function.__code__, _space, function.__name__))
    _space[function.__name__] = kernel
    return kernel


_compile(product._unit)
full_tank = _compile(product.full_tank)
account_step = _compile(product.step)
whole = _compile(product.whole)
