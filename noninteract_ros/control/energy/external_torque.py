# SPDX-License-Identifier: Apache-2.0
"""External torque on a team: measured at its tools, or estimated."""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.energy.momentum_observer import MomentumObserver
from noninteract_ros.team.team import Team, TeamState


class ExternalTorque:
    """The external torque at each tick.

    Args:
        team: The robots.
        measured: Whether wrenches on the tools are given; else a momentum observer estimates.
        gain: Bandwidth of the observer [1/s].
    """

    def __init__(self, team: Team, measured: bool, gain: float) -> None:
        self._team = team
        self._observer = None if measured else MomentumObserver(team, gain)
        self._sent: Array = np.zeros(team.n)

    def reset(self) -> None:
        """Begin anew."""
        self._sent = np.zeros_like(self._sent)
        if self._observer is not None:
            self._observer.reset()

    def record(self, torque: Array) -> None:
        """Store the torque that is sent now, shape (n,)."""
        self._sent = torque

    def update(self, elapsed: float, q: Array, v: Array, applied: Array | None) -> None:
        """Update the estimate at a state; `applied` is the torque until then, None as sent."""
        if self._observer is not None:
            self._observer.step(elapsed, q, v, self._sent if applied is None else applied)

    def torque(self, state: TeamState, wrenches: Array | None) -> Array:
        """Return tau_e at a state, (n,), from wrenches on the tools, (N, 6), if measured."""
        if self._observer is not None:
            return self._observer.external
        if wrenches is None:
            return np.zeros(self._team.n)
        return self._team.external_torque(state, wrenches)
