# SPDX-License-Identifier: Apache-2.0
"""Assembly of one team state from robot states with different stamps."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array

PREDICTIONS = ("velocity", "acceleration")
SECOND = 10**9


@dataclass(frozen=True, slots=True)
class AssembledState:
    """State of all joints at one time.

    Attributes:
        stamp_ns: Newest stamp of all joints [ns].
        position: Positions at the stamp, shape (n,) [m or rad].
        velocity: Velocities at the stamp, shape (n,) [m/s or rad/s].
        effort: Measured efforts, shape (n,) [N or N m]; NaN where unknown.
        ages: Age of each joint's own state at the stamp, shape (n,) [s].
        late: True for joints whose state is too old for a prediction, shape (n,).
    """

    stamp_ns: int
    position: Array
    velocity: Array
    effort: Array
    ages: Array
    late: NDArray[np.bool_]


class StateAssembler:
    """Prediction of all joints to the newest stamp among their latest states.

    Over an age d, prediction by constant velocity gives q + v d and v. For accelerations below
    a_max, its error is at most a_max d^2 / 2 in position and a_max d in velocity. Prediction by
    constant acceleration gives q + v d + a d^2 / 2 and v + a d, with a measured as the last
    difference of velocities over its time h. For jerks below j_max, its error is at most
    j_max (d^3 / 6 + h d^2 / 4) and j_max (d^2 + h d) / 2, but velocity noise is amplified by
    1 + 2 d / h. At age 0 states are returned unchanged, to the bit.

    A joint older than `max_skew` is not predicted: its last position is used, with velocity zero.

    Args:
        names: Joints of the team.
        prediction: Quantity that is assumed constant, one of `PREDICTIONS`.
        max_skew: Largest age that is predicted over [s].
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
        """Store the latest state of some joints.

        Args:
            joints: Indices of m joints in the team's order.
            stamp_ns: Stamp of the state [ns].
            position: Positions, shape (m,) [m or rad].
            velocity: Velocities, shape (m,) [m/s or rad/s].
            effort: Efforts, shape (m,) [N or N m], NaN where unknown; None if all are unknown.
        """
        elapsed = (stamp_ns - self._stamps[joints]) / SECOND
        measurable = (elapsed > 0.0) & (elapsed <= self._max_skew)
        change = velocity - self._v[joints]
        rate = np.divide(change, elapsed, out=np.zeros_like(change), where=measurable)
        # A repeated state has no information about the acceleration.
        self._a[joints] = np.where(elapsed == 0.0, self._a[joints], rate)
        self._q[joints], self._v[joints] = position, velocity
        self._effort[joints] = np.nan if effort is None else effort
        self._stamps[joints] = stamp_ns
        self._fresh[joints] = True

    def reset(self, joints: NDArray[np.intp]) -> None:
        """Discard the states of joints, e.g. after a restart of their clock."""
        self._stamps[joints], self._fresh[joints] = -1, False
        self._a[joints] = 0.0

    @property
    def missing(self) -> list[str]:
        """Joints without a state."""
        return [self.names[joint] for joint in np.flatnonzero(self._stamps < 0)]

    @property
    def ready(self) -> bool:
        """True if every joint has a state, at least one of them new since the last assembly."""
        return bool(self._fresh.any() and self._stamps.min() >= 0)

    @property
    def simultaneous(self) -> bool:
        """True if all joints have a new state since the last assembly, with the same stamp."""
        return bool(self._fresh.all() and self._stamps.min() == self._stamps.max())

    def assemble(self) -> AssembledState:
        """Return the state of the team at the newest stamp; requires a state of every joint."""
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
        return AssembledState(
            stamp_ns=newest,
            position=q,
            velocity=v,
            effort=self._effort.copy(),
            ages=ages,
            late=late,
        )
