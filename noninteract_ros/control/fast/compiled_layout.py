# SPDX-License-Identifier: Apache-2.0
"""Layout with compiled differences, for the controller."""

from collections.abc import Callable
from functools import cached_property, partial

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.subtasks.layout import Layout, ValueMotion


class CompiledLayout(Layout):
    """Layout whose differences of single values are compiled.

    Arrays are copied first: read-only or non-contiguous arrays would compile another
    specialisation.

    Args:
        layout: The layout.
    """

    def __init__(self, layout: Layout) -> None:
        vars(self).update(vars(layout))

    @cached_property
    def _functions(self) -> tuple[Callable[..., Array], Callable[..., tuple[Array, Array]]]:
        """Compiled difference and deviation; numba is imported at the first use."""
        from noninteract_ros.control.fast.kernels.motions import Numbers, deviation, difference

        begin = self.quaternions[:, 0].copy(), self.angular[:, 0].copy()
        numbers = Numbers(self.values, self.rates, self._angle_rates, *begin)
        return partial(difference, numbers), partial(deviation, numbers)

    def prepare(self) -> None:
        """Compile both methods, which must not happen within a tick."""
        rest = self.identity, np.zeros(self.dim), np.zeros(self.dim)
        self.difference(self.identity, self.identity)
        self.deviation(rest, rest, 0.0)

    def difference(self, x: Array, x_d: Array) -> Array:
        """Return x - x_d of single values; log(R R_d') for rotations, shape (dim,)."""
        return self._functions[0](np.array(x), np.array(x_d))

    def deviation(
        self, motion: ValueMotion, before: ValueMotion, dt: float
    ) -> tuple[Array, Array]:
        """Return the difference, and its rate, of a motion from an extrapolated earlier one."""
        x, velocity = np.array(motion[0]), np.array(motion[1])
        x_b, velocity_b, acceleration_b = (np.array(item) for item in before)
        return self._functions[1](x, velocity, x_b, velocity_b, acceleration_b, dt)
