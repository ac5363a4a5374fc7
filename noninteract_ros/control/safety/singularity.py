# SPDX-License-Identifier: Apache-2.0
"""Singularities, where assumption 3 fails: share of the decoupling, and recovery."""

from typing import Protocol

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.decoupling import inverse
from noninteract_ros.control.safety.settings import SafetySettings
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team

SAMPLES = 50  # configurations among which the team's best regularity is taken
REACH = np.pi  # [m or rad] range around the initial position of joints without limits
RAMP = 0.2  # [s] in which the pull comes, and goes at a stop


def regularity(S: Array) -> float:
    """Return 1 / |J^-1|_F: smooth, 0 where J is singular, at most its least singular value."""
    norm = float(np.linalg.norm(S))
    return 1.0 / norm if np.isfinite(norm) and norm > 0.0 else 0.0


def joint_range(team: Team) -> tuple[Array, Array]:
    """Return lowest and highest joint positions, (n,) each; `REACH` from q0 without a limit."""
    start = team.joints_from_configuration(team.q0)
    lower, upper = team.position_limits
    lower = np.where(np.isfinite(lower), lower, start - REACH)
    return lower, np.where(np.isfinite(upper), upper, start + REACH)


def best_regularity(team: Team, stack: SubtaskStack) -> float:
    """Return the largest regularity at q0 and at random configurations within joint limits.

    The initial one alone is no measure: it may be singular.
    """
    rng = np.random.default_rng(0)
    lower, upper = joint_range(team)
    still = np.zeros(team.n)
    best = regularity(inverse(stack.evaluate(team.state(team.q0, still)).J))
    for _ in range(SAMPLES):
        q = team.configuration_from_joints(rng.uniform(lower, upper))
        best = max(best, regularity(inverse(stack.evaluate(team.state(q, still)).J)))
    return best


class EscapeSearch(Protocol):
    """Search for a regular configuration; see `SingularityEscape`."""

    def reset(self) -> None:
        """Have the next search start where the team is then."""

    def goal(self, q: Array) -> Array:
        """Return where to go from a configuration, shape (nq,)."""


class SingularityGuard:
    """Share of the decoupling by the regularity of J, and a pull to regular states.

    The share falls continuously with the regularity. Where it is below 1 the team is pulled back,
    damped, to its last regular configuration. A team without one is pulled to where the escape
    search leads, or only damped.

    Args:
        team: The robots.
        settings: Thresholds and gains.
        best: Regularity that counts as 1.
        escape: Search for regular configurations, or None.
    """

    def __init__(
        self, team: Team, settings: SafetySettings, best: float, escape: EscapeSearch | None = None
    ) -> None:
        self._team, self._settings, self._best = team, settings, best
        self._escape = escape if settings.singularity_escape else None
        self._regular: Array | None = None
        self._pull = 0.0

    @property
    def searching(self) -> bool:
        """True while a regular configuration is searched for."""
        return self._regular is None and self._escape is not None

    def reset(self) -> None:
        """Drop the last regular configuration, as when the team is moved elsewhere."""
        self._regular, self._pull = None, 0.0
        if self._escape is not None:
            self._escape.reset()

    def relative(self, S: Array) -> float:
        """Return the regularity of S, or of its Frobenius norm, relative to the team's best."""
        return regularity(S) / self._best

    def law_share(self, relative: float) -> float:
        """Return the share: 1 where regular, 0 at a singularity, once differentiable between."""
        begin, end = self._settings.singularity_begin, self._settings.singularity_end
        if relative >= begin:
            return 1.0
        progress = max(0.0, (relative - end) / (begin - end))
        return float(progress**2 * (3.0 - 2.0 * progress))

    def pull(self, q: Array, share: float, stopped: bool, step: float) -> Array | None:
        """Return the joint acceleration that leads out, shape (n,), or None; once at each tick.

        Args:
            q: Configuration, shape (nq,).
            share: Share of the decoupling.
            stopped: True where the team is to come to rest where it is.
            step: Time since the last tick [s].
        """
        if share == 1.0:
            self._regular, self._pull = q, 1.0
            return None
        goal = self._regular
        if goal is None:
            if self._escape is None:
                return None
            goal = self._escape.goal(q)
        change = step / RAMP
        self._pull = max(0.0, self._pull - change) if stopped else min(1.0, self._pull + change)
        way = self._team.difference(q, goal)
        return (1.0 - share) * self._settings.recovery_stiffness * self._pull * way

    def damping(self, share: float) -> float:
        """Return the rate [1/s] at which all joints are damped beside the law."""
        return (1.0 - share) * self._settings.recovery_damping
