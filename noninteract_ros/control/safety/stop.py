# SPDX-License-Identifier: Apache-2.0
"""Damping that brings a stopped team to rest and keeps it there."""

import numpy as np

from noninteract_ros.arrays import Array

RAMP = 4.0  # Length of the ramp in units of 1 / rate: exp(-2) of the velocity is left after it.
JERKS = 4.0  # Jerk of a stop in units of the references': no later at rest than after a release.
RANGE = 2.0  # How many times as fast the slowest motions are stopped as the fastest ones.


class Stop:
    """Damping v_dot = -d(t) v of all joints, which rises from zero: no torque steps, none is late.

    With d = rate^2 t / RAMP up to the rate the velocity falls along a bell curve, steepest with
    0.3 rate v0, and exponentially from there on: after 7.3 / rate it is a two-hundredth. Whatever
    d >= 0 does, M v_dot = -d M v takes energy out of the team and never puts any in.

    The jerk is greatest at first, rate^2 v0 / RAMP. With JERKS times the jerk j that references
    may have, rate = 4 sqrt(j / v0), it is at rest after 1.8 sqrt(v0 / j), sooner than a reference
    that is let go, which takes 2 sqrt(v0 / j).

    Args:
        rate: Decay rate of fast motions once the damping is in full force [1/s].
        max_jerk: Bounds of the references of all subtasks, shape (n,) [m/s^3; rad/s^3].
    """

    def __init__(self, rate: float, max_jerk: Array) -> None:
        self._slowest, self._max_jerk = rate, max_jerk
        self._rate = rate
        self.reset()

    @property
    def ramp_time(self) -> float:
        """Time in which the damping of this stop rises [s]."""
        return RAMP / self._rate

    def reset(self) -> None:
        """Have the damping in full force, as of a stop that began long ago."""
        self._began = -np.inf

    def begin(self, now: float, velocity: Array) -> None:
        """Begin a stop at a time [s].

        Args:
            now: The time [s].
            velocity: Of the subtasks, shape (n,) [m/s; rad/s].
        """
        self._began = now
        speed_over_jerk = float(np.max(np.abs(velocity) / self._max_jerk))
        quickest = RANGE * self._slowest
        fitting = np.sqrt(RAMP * JERKS / speed_over_jerk) if speed_over_jerk > 0.0 else quickest
        self._rate = float(np.clip(fitting, self._slowest, quickest))

    def damping(self, now: float) -> float:
        """Return d [1/s] at a time [s]."""
        return self._rate * min(1.0, (now - self._began) / self.ramp_time)
