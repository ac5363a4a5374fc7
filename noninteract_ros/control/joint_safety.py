# SPDX-License-Identifier: Apache-2.0
"""What keeps arms whole where the law alone would not: singularities and the limits of joints.

Nothing here acts on a team that stays inside its limits: the torque is then the law's, to the bit.
"""

from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import key
from noninteract_ros.team.team import Team


@dataclass(frozen=True)
class SafetySettings:
    """The block `safety` of a scenario."""

    singularity_begin: float = key(
        "Regularity, relative to the initial one, below which the law begins to fade out",
        0.1,
        minimum=0.0,
        maximum=1.0,
    )
    singularity_end: float = key(
        "Relative regularity below which the team only recovers", 0.03, minimum=0.0, maximum=1.0
    )
    recovery_stiffness: float = key(
        "Pull back to the last regular configuration [1/s^2]", 25.0, minimum=0.0
    )
    recovery_damping: float = key("Damping of the recovery [1/s]", 10.0, positive=True)
    position_margin: float = key(
        "Distance to a joint limit at which it begins to repel [m or rad]", 0.1, positive=True
    )
    position_stiffness: float = key(
        "Stiffness of that repulsion [N/m or N m/rad]", 200.0, minimum=0.0
    )
    position_damping: float = key(
        "Damping of a joint at its limit [N s/m or N m s/rad]", 10.0, minimum=0.0
    )
    velocity_damping: float = key(
        "Damping of what a joint is too fast [N s/m or N m s/rad]", 20.0, minimum=0.0
    )
    torque_rate: float = key(
        "Largest change of a joint torque per second [N/s or N m/s]; 0: none", 0.0, minimum=0.0
    )

    def check(self) -> None:
        """Refuses thresholds in the wrong order.

        Raises:
            ScenarioError: `singularity_end` is not below `singularity_begin`.
        """
        if self.singularity_end >= self.singularity_begin > 0.0:
            allowed = f"< singularity_begin ({self.singularity_begin:g})"
            raise ScenarioError("safety.singularity_end", self.singularity_end, allowed)


@dataclass(frozen=True, slots=True)
class SafetyReport:
    """What was necessary at one tick.

    Attributes:
        effort_share: Share of the torque beyond gravity that effort limits leave.
        rate_share: Share of the torque's change that the rate limit leaves.
        repelled: Joints that a position limit repels, as indices.
        too_fast: Joints that are beyond their velocity limit, as indices.
    """

    effort_share: float
    rate_share: float
    repelled: tuple[int, ...]
    too_fast: tuple[int, ...]


def regularity(S: Array) -> float:
    """1 / |J^-1|_F: smooth, zero where J is singular, at most the smallest singular value of J."""
    norm = float(np.linalg.norm(S))
    return 1.0 / norm if np.isfinite(norm) and norm > 0.0 else 0.0


class JointSafety:
    """Blends, repels and bounds, joint by joint.

    Args:
        team: The robots, with their limits.
        settings: Thresholds and gains.
        initial_regularity: Regularity at the team's initial configuration.
    """

    def __init__(self, team: Team, settings: SafetySettings, initial_regularity: float) -> None:
        self._team, self._settings = team, settings
        self._scale = initial_regularity
        self._regular = team.q0
        self._last_torque: Array | None = None
        lower, upper = team.position_limits
        self._bounded = bool(np.isfinite(team.position_limits).any())
        # Two margins never overlap, however narrow the range of a joint is.
        margin = np.minimum(settings.position_margin, 0.25 * (upper - lower))
        self._margin = np.where(np.isfinite(margin), margin, settings.position_margin)
        self._lower, self._upper = lower + self._margin, upper - self._margin
        self._fast = bool(np.isfinite(team.velocity_limits).any())

    def reset(self) -> None:
        """Forgets the last torque, as when the team starts anew."""
        self._last_torque = None

    def blend(self, q: Array, v: Array, wanted: Array, S: Array) -> tuple[Array, float, float]:
        """Joint acceleration near singularities, shape (n,).

        The law fades out continuously as the regularity falls; in its place the team is pulled
        back, damped, to the last configuration that was regular, and so leaves by itself.

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (n,).
            wanted: What the law asks for, shape (n,).
            S: Inverse of the task Jacobian, shape (n, n).

        Returns:
            The acceleration, the share of the law and the relative regularity.
        """
        relative = regularity(S) / self._scale
        begin, end = self._settings.singularity_begin, self._settings.singularity_end
        if relative >= begin:
            self._regular = q
            return wanted, 1.0, relative
        progress = np.clip((relative - end) / (begin - end), 0.0, 1.0)
        share = float(progress**2 * (3.0 - 2.0 * progress))
        pull = self._settings.recovery_stiffness * self._team.difference(q, self._regular)
        recovery = pull - self._settings.recovery_damping * v
        if share == 0.0:
            return recovery, 0.0, relative
        return share * wanted + (1.0 - share) * recovery, share, relative

    def protect(
        self, q: Array, v: Array, torque: Array, gravity: Array, step: float
    ) -> tuple[Array, SafetyReport]:
        """Torque within the limits of the joints, shape (n,).

        Position limits repel by a potential with damping and velocity limits damp, both passive.
        The change and the size of the torque are bounded by shrinking it towards the last torque
        and towards gravity, so that its direction is kept.

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (n,).
            torque: What the law asks for, shape (n,) [N or N m].
            gravity: Gravity torque, shape (n,) [N or N m].
            step: Time since the last tick [s]; 0 at a start.
        """
        repulsion, repelled = self._repulsion(q, v)
        braking, too_fast = self._braking(v)
        if repelled or too_fast:
            torque = torque + repulsion + braking
        rate_share = 1.0
        rate = self._settings.torque_rate
        if rate > 0.0 and step > 0.0 and self._last_torque is not None:
            change = torque - self._last_torque
            rate_share = _share(change, np.full_like(change, rate * step))
            if rate_share < 1.0:
                torque = self._last_torque + rate_share * change
        room = np.maximum(self._team.effort_limits - np.abs(gravity), 0.0)
        effort_share = _share(torque - gravity, room)
        if effort_share < 1.0:
            torque = gravity + effort_share * (torque - gravity)
            torque = np.clip(torque, -self._team.effort_limits, self._team.effort_limits)
        self._last_torque = torque
        report = SafetyReport(effort_share, rate_share, repelled, too_fast)
        return torque, report

    def _repulsion(self, q: Array, v: Array) -> tuple[Array, tuple[int, ...]]:
        if not self._bounded:
            return np.zeros_like(v), ()
        position = self._team.joints_from_configuration(q)
        inside = np.clip(position, self._lower, self._upper)
        depth = position - inside
        if not depth.any():
            return np.zeros_like(v), ()
        damping = self._settings.position_damping * np.minimum(np.abs(depth) / self._margin, 1.0)
        torque = -self._settings.position_stiffness * depth - damping * v
        return torque, tuple(np.flatnonzero(depth).tolist())

    def _braking(self, v: Array) -> tuple[Array, tuple[int, ...]]:
        if not self._fast:
            return np.zeros_like(v), ()
        limits = self._team.velocity_limits
        excess = v - np.clip(v, -limits, limits)
        return -self._settings.velocity_damping * excess, tuple(np.flatnonzero(excess).tolist())


def _share(vector: Array, room: Array) -> float:
    """Largest share of a vector, at most 1, that fits into room to both sides."""
    size = np.abs(vector)
    over = size > room
    return float(np.min(room[over] / size[over])) if over.any() else 1.0
