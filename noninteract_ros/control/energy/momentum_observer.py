# SPDX-License-Identifier: Apache-2.0
"""External torque on a team, estimated from its motion."""

import numpy as np
import pinocchio as pin

from noninteract_ros.arrays import Array
from noninteract_ros.team.team import Team


class MomentumObserver:
    """The generalised momentum p = M v against what is known to change it.

        dp/dt = tau + C' v - g - F v + tau_e
        r = K (p - integral of (tau + C' v - g - F v + r)),    dr/dt = K (tau_e - r)

    so that r follows tau_e at first order, whatever the motion. The integral takes the torque as
    it was held and the rest by the trapezoidal rule; r is found implicitly, stable at any K T.

    Args:
        team: The robots, with their viscous friction F.
        gain: K [1/s].
    """

    def __init__(self, team: Team, gain: float) -> None:
        self._team, self._gain = team, gain
        self._data = team.model.createData()
        self._lower = np.tri(team.n, k=-1, dtype=bool)
        self.reset()

    def reset(self) -> None:
        """Begin anew with no external torque."""
        self._last: tuple[Array, Array] | None = None
        self.external: Array = np.zeros(self._team.n)

    def step(self, elapsed: float, q: Array, v: Array, torque: Array) -> Array:
        """Return the estimate of the external torque at a state, shape (n,) [N or N m].

        Args:
            elapsed: Time since the last state [s].
            q: Configuration, shape (nq,).
            v: Velocity, shape (n,).
            torque: Control torque that was applied since the last state, shape (n,).
        """
        momentum, drift = self._terms(q, v)
        if self._last is not None and elapsed > 0.0:
            gained = momentum - self._last[0]
            known = elapsed * (torque + 0.5 * (drift + self._last[1]))
            r = self.external + self._gain * (gained - known)
            self.external = r / (1.0 + self._gain * elapsed)
        self._last = (momentum, drift)
        return self.external

    def _terms(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return M v and C' v - g - F v, shape (n,) each."""
        model, data = self._team.model, self._data
        M = pin.crba(model, data, q).copy()
        np.copyto(M, M.T, where=self._lower)
        C = pin.computeCoriolisMatrix(model, data, q, v)
        drift = C.T @ v - self._team.gravity(q) - self._team.friction * v
        return M @ v, drift
