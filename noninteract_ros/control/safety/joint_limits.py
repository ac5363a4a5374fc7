# SPDX-License-Identifier: Apache-2.0
"""What keeps arms whole where the law alone would not: the limits of their joints.

Nothing here acts on a team that stays inside its limits: the torque is then the law's, to the bit.
"""

from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.safety.settings import SafetySettings
from noninteract_ros.team.team import Team


@dataclass(frozen=True, slots=True)
class SafetyReport:
    """What was necessary at one tick.

    Attributes:
        effort_share: Share of the torque beyond gravity that effort limits leave of the law's.
        rate_share: Share of the torque's change that the rate limit leaves.
        repelled: Joints that a position limit repels, as indices.
        too_fast: Joints that are beyond their velocity limit, as indices.
        finite: Whether the law gave a torque at all.
        clipped: Whether repulsion and brake together were more than the effort limits allow.
    """

    effort_share: float = 1.0
    rate_share: float = 1.0
    repelled: tuple[int, ...] = ()
    too_fast: tuple[int, ...] = ()
    finite: bool = True
    clipped: bool = False

    @property
    def cut(self) -> bool:
        """Whether something was cut off from the torque."""
        return self.effort_share < 1.0 or self.rate_share < 1.0 or self.clipped

    @property
    def acted(self) -> bool:
        """Whether the torque is another one than the law's."""
        return self.cut or bool(self.repelled or self.too_fast) or not self.finite


class JointSafety:
    """Bounds, repels and brakes, joint by joint.

    Repulsion and brake are sized by each joint's own inertia at the team's initial configuration,
    so that they suit a shoulder and a wrist alike and stay slow against the ticks.

    Args:
        team: The robots, with their limits.
        settings: Margins and rates.
    """

    def __init__(self, team: Team, settings: SafetySettings) -> None:
        self._team = team
        self._torque_rate = settings.torque_rate
        self._last_torque: Array | None = None
        M = team.state(team.q0, np.zeros(team.n)).M
        inertia = 1.0 / np.diag(np.linalg.inv(M))  # Of a joint when all others are free.
        self._stiffness = settings.position_rate**2 * inertia
        self._damping = 2.0 * settings.position_rate * inertia
        self._braking = settings.velocity_rate * inertia
        lower, upper = team.position_limits
        # Two margins never overlap, however narrow the range of a joint is.
        margin = np.minimum(settings.position_margin, 0.25 * (upper - lower))
        self._margin = np.maximum(margin, 1e-9)
        self._lower, self._upper = lower + margin, upper - margin
        self._bounded = bool(np.isfinite(team.position_limits).any())
        self._limited = bool(np.isfinite(team.effort_limits).any())
        self._fast = bool(np.isfinite(team.velocity_limits).any())

    def reset(self) -> None:
        """Forgets the last torque, as when the team starts anew."""
        self._last_torque = None

    def protect(
        self, q: Array, v: Array, torque: Array, gravity: Array, elapsed: float
    ) -> tuple[Array, SafetyReport]:
        """Torque within the limits of the joints, shape (n,); always finite.

        The law's torque is shrunk towards gravity until it fits the effort limits, so that its
        direction is kept; then joints near their position limits are repelled and joints that
        are too fast are braked, both passively; at last the change since the last tick is shrunk
        until it fits the rate limit. A torque that is not finite is replaced by gravity and the
        robots' brakes.

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (n,).
            torque: What the law asks for, shape (n,) [N or N m].
            gravity: Gravity torque, shape (n,) [N or N m].
            elapsed: Time since the last torque [s].
        """
        finite = bool(np.isfinite(torque).all())
        if not finite:
            torque = gravity - self._team.brake_damping * v
        torque, effort_share = self._within_efforts(torque, gravity)
        repulsion, repelled = self._repulsion(q, v)
        brake, too_fast = self._brake(v)
        clipped = False
        if repelled or too_fast:
            torque = torque + repulsion + brake
            within = np.clip(torque, -self._team.effort_limits, self._team.effort_limits)
            clipped, torque = bool((within != torque).any()), within
        rate_share = 1.0
        if self._torque_rate > 0.0 and self._last_torque is not None:
            change = torque - self._last_torque
            room = np.full_like(change, self._torque_rate * elapsed)
            rate_share = _share(change, -room, room)
            if rate_share < 1.0:
                torque = self._last_torque + rate_share * change
        self._last_torque = torque
        return torque, SafetyReport(effort_share, rate_share, repelled, too_fast, finite, clipped)

    def _within_efforts(self, torque: Array, gravity: Array) -> tuple[Array, float]:
        if not self._limited:
            return torque, 1.0
        limits = self._team.effort_limits
        if not (np.abs(torque) > limits).any():
            return torque, 1.0
        holding = np.clip(gravity, -limits, limits)
        share = _share(torque - holding, -limits - holding, limits - holding)
        return np.clip(holding + share * (torque - holding), -limits, limits), share

    def _repulsion(self, q: Array, v: Array) -> tuple[Array, tuple[int, ...]]:
        """-dV/dq - d(q) v with V = k depth^2 / 2 of the depth in the margin, shape (n,)."""
        none = np.zeros_like(v)
        if not self._bounded:
            return none, ()
        position = self._team.joints_from_configuration(q)
        depth = _beyond(position, self._lower, self._upper)
        if not depth.any():
            return none, ()
        damping = self._damping * np.minimum(np.abs(depth) / self._margin, 1.0)
        torque = -self._stiffness * depth - damping * v
        return torque, tuple(np.flatnonzero(depth).tolist())

    def _brake(self, v: Array) -> tuple[Array, tuple[int, ...]]:
        none = np.zeros_like(v)
        if not self._fast:
            return none, ()
        limits = self._team.velocity_limits
        excess = _beyond(v, -limits, limits)
        if not excess.any():
            return none, ()
        return -self._braking * excess, tuple(np.flatnonzero(excess).tolist())


def _beyond(values: Array, lower: Array, upper: Array) -> Array:
    """How far values are beyond bounds, shape (n,); zero between them."""
    return np.minimum(values - lower, 0.0) + np.maximum(values - upper, 0.0)


def _share(vector: Array, lower: Array, upper: Array) -> float:
    """Largest share of a vector, at most 1, that lies between bounds around zero."""
    bound = np.where(vector > 0.0, upper, lower)
    over = np.abs(vector) > np.abs(bound)
    return float(np.min(bound[over] / vector[over])) if over.any() else 1.0
