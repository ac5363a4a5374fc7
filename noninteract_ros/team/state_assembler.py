# SPDX-License-Identifier: Apache-2.0
"""One state of the team from states that its robots told at different times."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array

PREDICTIONS = ("velocity", "acceleration")
SECOND = 10**9


@dataclass(frozen=True, slots=True)
class AssembledState:
    """All joints at one time.

    Attributes:
        stamp_ns: The time: the newest that any joint was told of [ns].
        position: Shape (n,) [m or rad].
        velocity: Shape (n,) [m/s or rad/s].
        effort: Shape (n,) [N or N m]; NaN where none was told.
        ages: How much older each joint's own state is, shape (n,) [s].
        late: Joints whose state is too old to be carried on, shape (n,).
    """

    stamp_ns: int
    position: Array
    velocity: Array
    effort: Array
    ages: Array
    late: NDArray[np.bool_]


class StateAssembler:
    """Keeps the newest of each joint and brings all to the newest time among them.

    Over an age d a joint is carried on with constant velocity: q + v d, v. With accelerations
    below a_max that is wrong by at most a_max d^2 / 2 in position and a_max d in velocity. With
    constant acceleration, which is measured as the last difference of velocities over its time h:
    q + v d + a d^2 / 2, v + a d; with a rate of acceleration below j_max that is wrong by at most
    j_max (d^3 / 6 + h d^2 / 4) and j_max (d^2 + h d) / 2, but noise in velocities grows by
    1 + 2 d / h. At age 0 nothing is changed, to the bit.

    A joint that is older than `max_skew` is not carried on: it is taken to rest where it was.

    Args:
        names: Joints of the team.
        prediction: One of `PREDICTIONS`.
        max_skew: Largest age that is bridged [s].
    """

    def __init__(self, names: Sequence[str], prediction: str, max_skew: float) -> None:
        count = len(names)
        self.names = tuple(names)
        self._accelerated, self._max_skew = prediction == "acceleration", max_skew
        self._stamps = np.full(count, -1, dtype=np.int64)
        self._q, self._v, self._a = np.zeros((3, count))
        self._effort = np.full(count, np.nan)
        self._fresh = np.zeros(count, dtype=bool)

    def update(
        self,
        joints: NDArray[np.intp],
        stamp_ns: int,
        position: Array,
        velocity: Array,
        effort: Array | None = None,
    ) -> None:
        """Takes what some joints were at a time.

        Args:
            joints: Places of m joints in the team's order.
            stamp_ns: The time [ns].
            position: Shape (m,).
            velocity: Shape (m,).
            effort: Shape (m,), NaN where unknown; None, where none is.
        """
        elapsed = (stamp_ns - self._stamps[joints]) / SECOND
        measurable = (elapsed > 0.0) & (elapsed <= self._max_skew)
        change = velocity - self._v[joints]
        rate = np.divide(change, elapsed, out=np.zeros_like(change), where=measurable)
        # A state that is told again tells nothing new of the acceleration.
        self._a[joints] = np.where(elapsed == 0.0, self._a[joints], rate)
        self._q[joints], self._v[joints] = position, velocity
        self._effort[joints] = np.nan if effort is None else effort
        self._stamps[joints] = stamp_ns
        self._fresh[joints] = True

    def reset(self, joints: NDArray[np.intp]) -> None:
        """Forgets joints whose clock starts anew."""
        self._stamps[joints], self._fresh[joints] = -1, False
        self._a[joints] = 0.0

    @property
    def missing(self) -> list[str]:
        """Joints of which nothing was told so far."""
        return [self.names[joint] for joint in np.flatnonzero(self._stamps < 0)]

    @property
    def ready(self) -> bool:
        """Whether every joint is known, and something was told since the last assembly."""
        return bool(self._fresh.any() and self._stamps.min() >= 0)

    @property
    def simultaneous(self) -> bool:
        """Whether all joints were told of since the last assembly, and of the same time."""
        return bool(self._fresh.all() and self._stamps.min() == self._stamps.max())

    def assemble(self) -> AssembledState:
        """The team at the newest time that was told; every joint has to be known."""
        newest = int(self._stamps.max())
        ages = (newest - self._stamps) / SECOND
        late = ages > self._max_skew
        self._fresh[:] = False
        q, v = self._q.copy(), self._v.copy()
        if ages.any():
            d = np.where(late, 0.0, ages)
            v[late] = 0.0
            q += v * d
            if self._accelerated:
                q += 0.5 * self._a * d**2
                v += self._a * d
        return AssembledState(newest, q, v, self._effort.copy(), ages, late)
