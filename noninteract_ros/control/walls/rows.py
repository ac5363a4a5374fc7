# SPDX-License-Identifier: Apache-2.0
"""Constraints C a >= b on the joint acceleration."""

from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.walls.settings import WallSettings
from noninteract_ros.team.geometry.clearance import Clearances
from noninteract_ros.team.geometry.kernels.kinematics import Indices
from noninteract_ros.team.team import Team

SPEED_TIME = 0.03  # [s] in which a joint comes back to its speed limit
LEVER = 1e-3  # [m/rad] below which a joint does not move a pair apart
PAIRS = 1_000_000  # labels of pairs start here, those of joints at zero


@dataclass(frozen=True, slots=True)
class Rows:
    """Constraints at a state.

    Attributes:
        C: Shape (m, n).
        b: Shape (m,).
        labels: Number of each, by which ticks know it again, shape (m,).
    """

    C: Array
    b: Array
    labels: Indices


def approach_limit(gap: Array, rate_of_change: Array, drift: Array | float, rate: float) -> Array:
    """Return b with which z = Cv + k gap never turns negative, shape (m,).

    C a + drift >= -2 k Cv - k^2 gap is z_rate >= -k z: a gap closes at most as exp(-k t) does.

    Args:
        gap: Distance beyond the margin, shape (m,).
        rate_of_change: Cv, shape (m,).
        drift: d(C)/dt v, shape (m,).
        rate: k [1/s].
    """
    return -2.0 * rate * rate_of_change - rate**2 * gap - drift


def pair_rows(found: Clearances, margins: Array, rate: float) -> Rows:
    """Return a row per pair of bodies that joints can move apart.

    Args:
        found: Clearances.
        margins: Margins of these pairs, shape (k,) [m].
        rate: k [1/s].
    """
    moved = np.abs(found.rows).max(axis=1, initial=0.0) > LEVER
    gap = (found.distances - margins)[moved]
    b = approach_limit(gap, found.rates[moved], found.drifts[moved], rate)
    return Rows(found.rows[moved], b, PAIRS + found.pairs[moved])


class JointRows:
    """Rows of position and speed limits.

    Args:
        team: The robots.
        settings: Margins and rates.
        start: Joint positions at the start: where they lie within a margin, that is narrower.
    """

    def __init__(self, team: Team, settings: WallSettings, start: Array) -> None:
        lower, upper = team.position_limits
        margin = np.minimum(settings.joint_margin, 0.25 * (upper - lower))
        self._lower = np.minimum(lower + margin, np.maximum(start, lower))
        self._upper = np.maximum(upper - margin, np.minimum(start, upper))
        self._low, self._high = (
            np.flatnonzero(np.isfinite(lower)),
            np.flatnonzero(np.isfinite(upper)),
        )
        self._fast = np.flatnonzero(np.isfinite(team.velocity_limits))
        self._speed = settings.speed_share * team.velocity_limits[self._fast]
        self._rate = settings.rate
        eye = np.eye(team.n)
        self._C = np.vstack([eye[self._low], -eye[self._high], -eye[self._fast], eye[self._fast]])
        self._labels = np.arange(len(self._C))

    def at(self, positions: Array, v: Array, keeps: bool = False) -> Rows:
        """Return the rows at joint positions and velocities, shape (n,) each.

        Args:
            positions: Shape (n,).
            v: Shape (n,).
            keeps: True where a joint inside a margin may stay there.
        """
        low, high, fast = self._low, self._high, self._fast
        lower, upper = positions[low] - self._lower[low], self._upper[high] - positions[high]
        if keeps:
            lower, upper = np.maximum(lower, 0.0), np.maximum(upper, 0.0)
        below = approach_limit(lower, v[low], 0.0, self._rate)
        above = approach_limit(upper, -v[high], 0.0, self._rate)
        faster = (v[fast] - self._speed) / SPEED_TIME
        backwards = (-v[fast] - self._speed) / SPEED_TIME
        return Rows(self._C, np.concatenate([below, above, faster, backwards]), self._labels)


def stacked(first: Rows, second: Rows) -> Rows:
    """Return the rows of both."""
    return Rows(
        np.vstack([first.C, second.C]),
        np.concatenate([first.b, second.b]),
        np.concatenate([first.labels, second.labels]),
    )
