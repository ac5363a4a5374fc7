# SPDX-License-Identifier: Apache-2.0
"""The damping that brings a stopped team to rest and keeps it there."""

import numpy as np

RAMP = 4.0  # Length of the ramp in units of 1 / rate: exp(-2) of the velocity is left after it.


class Stop:
    """Damping v_dot = -d(t) v of all joints, which rises from zero: no torque steps, none is late.

    With d = rate^2 t / RAMP up to the rate the velocity falls along a bell curve, steepest with
    0.3 rate v0, and exponentially from there on: after 7.3 / rate it is a two-hundredth. Whatever
    d >= 0 does, M v_dot = -d M v takes energy out of the team and never puts any in.

    Args:
        rate: Decay rate once the damping is in full force [1/s].
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self.ramp_time = RAMP / rate
        self.forget()

    def forget(self) -> None:
        """A stop of before: its damping is in full force."""
        self._began = -np.inf

    def begin(self, now: float) -> None:
        """A stop begins at a time [s]."""
        self._began = now

    def damping(self, now: float) -> float:
        """d [1/s] at a time [s]."""
        return self._rate * min(1.0, (now - self._began) / self.ramp_time)
