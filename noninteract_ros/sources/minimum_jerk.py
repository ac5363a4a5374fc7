# SPDX-License-Identifier: Apache-2.0
"""Minimum-jerk moves from rest to rest."""

import numpy as np
from numpy.typing import ArrayLike

from noninteract_ros.arrays import Array
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference


def blend(u: float) -> tuple[float, float, float]:
    """The quintic from 0 to 1 that starts and ends at rest.

    Args:
        u: Share of the duration that has passed; clipped to [0, 1].

    Returns:
        Value, and first and second derivative with respect to `u`.
    """
    u = min(max(u, 0.0), 1.0)
    return (
        u**3 * (10.0 + u * (6.0 * u - 15.0)),
        30.0 * u**2 * (1.0 - u) ** 2,
        60.0 * u * (1.0 - u) * (1.0 - 2.0 * u),
    )


class RestToRest:
    """Rests at the first value, then moves from each value to the next; C2 for all times.

    Move i leads from `values[i]` to `values[i + 1]`, beginning at `starts[i]` and lasting
    `durations[i]`. Moves are in order of time and do not overlap; between them the motion rests.
    Rotations go the shortest way, about a fixed axis.
    """

    def __init__(
        self,
        starts: ArrayLike,
        durations: ArrayLike,
        values: ArrayLike,
        layout: Layout | None = None,
    ) -> None:
        """Takes moves that were checked.

        Args:
            starts: Times at which the moves start [s], shape (n,), increasing.
            durations: Their durations [s], shape (n,), positive.
            values: Resting values, shape (n + 1, size).
            layout: Layout of a value; plain numbers, if None.
        """
        self._starts: Array = np.array(starts, dtype=np.float64)
        self._durations: Array = np.array(durations, dtype=np.float64)
        self._values: Array = np.array(values, dtype=np.float64)
        self._layout = layout or Layout.scalars(self._values.shape[1])

    def __call__(self, t: float) -> Reference:
        """The motion at time `t` [s]."""
        move = int(np.searchsorted(self._starts, t, side="right")) - 1
        if move < 0:
            return Reference.at_rest(self._values[0], self._layout)
        duration = float(self._durations[move])
        value, rate, curvature = blend((t - float(self._starts[move])) / duration)
        if value == 1.0:
            return Reference.at_rest(self._values[move + 1], self._layout)
        start = self._values[move]
        way = self._layout.difference(self._values[move + 1], start)
        # A rotation vector that keeps its direction changes as the angular velocity says.
        return Reference(
            self._layout.sum(start, value * way),
            rate / duration * way,
            curvature / duration**2 * way,
        )
