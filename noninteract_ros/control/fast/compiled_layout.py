# SPDX-License-Identifier: Apache-2.0
"""Layouts of a controller, whose differences at each tick are compiled."""

from collections.abc import Callable
from functools import cached_property, partial

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.subtasks.layout import Layout, ValueMotion


class CompiledLayout(Layout):
    """The same layout, quicker with single values.

    Arrays are copied: to numba those that are only for reading, or have gaps, are other kinds.

    Args:
        layout: The layout.
    """

    def __init__(self, layout: Layout) -> None:
        vars(self).update(vars(layout))

    @cached_property
    def _functions(self) -> tuple[Callable[..., Array], Callable[..., tuple[Array, Array]]]:
        """Difference and deviation; numba is imported by who needs them."""
        from noninteract_ros.control.fast.kernels.motions import Numbers, deviation, difference

        begin = self.quaternions[:, 0].copy(), self.angular[:, 0].copy()
        numbers = Numbers(self.values, self.rates, self._angle_rates, *begin)
        return partial(difference, numbers), partial(deviation, numbers)

    def prepare(self) -> None:
        """Has both methods compiled, which must not happen in a tick."""
        still = self.identity, np.zeros(self.dim), np.zeros(self.dim)
        self.difference(self.identity, self.identity)
        self.deviation(still, still, 0.0)

    def difference(self, x: Array, x_d: Array) -> Array:
        """x - x_d of single values; for rotations log(R R_d'), shape (dim,)."""
        return self._functions[0](np.array(x), np.array(x_d))

    def deviation(
        self, motion: ValueMotion, before: ValueMotion, dt: float
    ) -> tuple[Array, Array]:
        """Difference and its rate between a motion and where another one led `dt` s later."""
        x, velocity = np.array(motion[0]), np.array(motion[1])
        x_b, velocity_b, acceleration_b = (np.array(item) for item in before)
        return self._functions[1](x, velocity, x_b, velocity_b, acceleration_b, dt)
