# SPDX-License-Identifier: Apache-2.0
"""Margins of joint positions and speeds: potentials and brakes beside the law.

Nothing here acts on a team that stays inside its limits: the torque is then the law's, to the bit.
"""

from typing import NamedTuple

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.safety.settings import SafetySettings
from noninteract_ros.team.team import Team

DEEPENING = 1.0  # [s] in which a margin that found its joint inside comes into full force


class Guard(NamedTuple):
    """Margins at a state.

    Attributes:
        torque: -dV/dq - d(q) v and the brakes, shape (n,) [N or N m]; None for zero.
        repulsion: The part -dV/dq of it, shape (n,); None for zero.
        potential: V [J].
        repelled: Joints inside the margin of a position limit, as indices.
        too_fast: Joints beyond their velocity limit, as indices.
        onset: Depth in the margin at which each potential begins, shape (n,) [m or rad].
    """

    torque: Array | None
    repulsion: Array | None
    potential: float
    repelled: tuple[int, ...]
    too_fast: tuple[int, ...]
    onset: Array

    def with_torque(self, torque: Array) -> "Guard":
        """Return the same with another passive torque, shape (n,), beside it."""
        if not torque.any():
            return self
        return self._replace(torque=torque if self.torque is None else self.torque + torque)


class JointMargins:
    """Repels and brakes joint by joint.

    V = k (depth - onset)^2 / 2 beyond the onset. A joint that is found inside its margin begins
    with its own depth for an onset, so that nothing is released; the onset falls as the joint
    leaves by itself, or as somebody pays. Repulsion and brake are sized by each joint's own
    inertia at the team's initial configuration, so that they suit a shoulder and a wrist alike
    and stay slow against the ticks.

    Args:
        team: The robots, with their limits.
        settings: Margins and rates.
    """

    def __init__(self, team: Team, settings: SafetySettings) -> None:
        self._team = team
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
        self._fast = bool(np.isfinite(team.velocity_limits).any())
        self._none: Array = np.zeros(team.n)
        self._free = Guard(None, None, 0.0, (), (), self._none)

    def depth(self, q: Array) -> Array:
        """Return how far each joint is inside a margin, shape (n,), with the limit's sign."""
        if not self._bounded:
            return self._none
        return _beyond(self._team.joints_from_configuration(q), self._lower, self._upper)

    def potential(self, depth: Array, onset: Array) -> float:
        """Return V [J] of depths, shape (n,), that begins at onsets, shape (n,)."""
        excess = np.maximum(np.abs(depth) - onset, 0.0)
        return float(0.5 * (self._stiffness * excess) @ excess)

    def deeper(self, onset: Array, step: float) -> Array:
        """Return the onsets that a time [s] lets fall at most, shape (n,)."""
        return np.maximum(onset - self._margin * (step / DEEPENING), 0.0)

    def at(self, depth: Array, v: Array, onset: Array) -> Guard:
        """Return repulsion and brakes.

        Args:
            depth: Depths in the margins, shape (n,).
            v: Velocity, shape (n,).
            onset: Where the potentials begin, shape (n,), none beyond its joint's depth.
        """
        inside = self._bounded and bool(depth.any())
        excess = self._excess(v)
        if not inside and excess is None:
            return self._free
        torque, potential = np.zeros_like(v), 0.0
        repulsion: Array | None = None
        repelled: tuple[int, ...] = ()
        if inside:
            size = np.abs(depth)
            into = np.maximum(size - onset, 0.0)
            damping = self._damping * np.minimum(size / self._margin, 1.0)
            repulsion = -self._stiffness * np.copysign(into, depth)
            torque += repulsion - damping * v
            potential = float(0.5 * (self._stiffness * into) @ into)
            repelled = tuple(np.flatnonzero(depth).tolist())
        too_fast: tuple[int, ...] = ()
        if excess is not None:
            torque -= self._braking * excess
            too_fast = tuple(np.flatnonzero(excess).tolist())
        return Guard(
            torque, repulsion, potential, repelled, too_fast, onset if inside else self._none
        )

    def _excess(self, v: Array) -> Array | None:
        """Speed beyond the limits, shape (n,); None for none."""
        if not self._fast:
            return None
        limits = self._team.velocity_limits
        if not (np.abs(v) > limits).any():
            return None
        return _beyond(v, -limits, limits)


def _beyond(values: Array, lower: Array, upper: Array) -> Array:
    """Return how far values are beyond bounds, shape (n,); zero between them."""
    return np.minimum(values - lower, 0.0) + np.maximum(values - upper, 0.0)
