# SPDX-License-Identifier: Apache-2.0
"""Minimum-jerk moves from rest to rest."""

import numpy as np
from numpy.typing import ArrayLike

from noninteract_ros.arrays import Array
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference


def blend(u: float) -> tuple[float, float, float]:
    """Evaluate the quintic from 0 to 1 that starts and ends at rest.

    Args:
        u: Elapsed share of the duration; clipped to [0, 1].

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
    """Minimum-jerk moves through a sequence of resting values; C2 for all times.

    Move i leads from `values[i]` to `values[i + 1]`. It starts at `starts[i]` and lasts
    `durations[i]`. Moves are in order of time and do not overlap; between them the motion rests.
    Rotations take the shortest way, about a fixed axis.

    Args:
        starts: Start time of each move [s], shape (n,), increasing.
        durations: Duration of each move [s], shape (n,), positive.
        values: Resting values, shape (n + 1, size).
        layout: Layout of a value; plain numbers, if None.
    """

    def __init__(
        self,
        starts: ArrayLike,
        durations: ArrayLike,
        values: ArrayLike,
        layout: Layout | None = None,
    ) -> None:
        self._starts: Array = np.array(starts, dtype=np.float64)
        self._durations: Array = np.array(durations, dtype=np.float64)
        self._values: Array = np.array(values, dtype=np.float64)
        self._layout = layout or Layout.scalars(self._values.shape[1])

    def __call__(self, t: float) -> Reference:
        """Evaluate the motion at time `t` [s]."""
        move = int(np.searchsorted(self._starts, t, side="right")) - 1
        if move < 0:
            return Reference.at_rest(self._values[0], self._layout)
        duration = float(self._durations[move])
        value, rate, curvature = blend((t - float(self._starts[move])) / duration)
        if value == 1.0:
            return Reference.at_rest(self._values[move + 1], self._layout)
        start = self._values[move]
        displacement = self._layout.difference(self._values[move + 1], start)
        # A rotation vector of constant direction has the angular velocity as its rate.
        return Reference(
            self._layout.sum(start, value * displacement),
            rate / duration * displacement,
            curvature / duration**2 * displacement,
        )
