# SPDX-License-Identifier: Apache-2.0
"""Near singularities, where assumption 3 fails: the law fades out, and the team recovers."""

from typing import Protocol

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.decoupling import inverse
from noninteract_ros.control.safety.settings import SafetySettings
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team

SAMPLES = 50  # configurations that the team's best regularity is looked for among
REACH = np.pi  # [m or rad] how far from the initial position joints without limits are tried
RAMP = 0.2  # [s] in which the pull comes, and goes at a stop


def regularity(S: Array) -> float:
    """1 / |J^-1|_F: smooth, zero where J is singular, at most the smallest singular value of J."""
    norm = float(np.linalg.norm(S))
    return 1.0 / norm if np.isfinite(norm) and norm > 0.0 else 0.0


def joint_range(team: Team) -> tuple[Array, Array]:
    """Lowest and highest joint positions, (n,) each; without a limit, `REACH` from the start."""
    start = team.joints_from_configuration(team.q0)
    lower, upper = team.position_limits
    lower = np.where(np.isfinite(lower), lower, start - REACH)
    return lower, np.where(np.isfinite(upper), upper, start + REACH)


def best_regularity(team: Team, stack: SubtaskStack) -> float:
    """Largest regularity at the initial and at random configurations within joint limits.

    The initial one alone would not do as a measure: it may be anything, a singular one too.
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
    """Looks for a way out of a singularity, see `way_out`."""

    def forget(self) -> None:
        """The next search starts where the team is then."""

    def goal(self, q: Array) -> Array:
        """Where to go from a configuration, shape (nq,)."""


class SingularityGuard:
    """Blends the law with a recovery, by how regular the task Jacobian is.

    The law fades out continuously as the regularity falls. In its place the team is pulled back,
    damped, to the last configuration that was regular, and so leaves by itself. A team that was
    never seen regular is pulled where it is led out, or only damped, if there is nobody to lead.

    Args:
        team: The robots.
        settings: Thresholds and gains.
        best: Regularity that counts as 1.
        scout: Knows ever better configurations on the way out, or None.
    """

    def __init__(
        self, team: Team, settings: SafetySettings, best: float, scout: EscapeSearch | None = None
    ) -> None:
        self._team, self._settings, self._best = team, settings, best
        self._scout = scout if settings.singularity_escape else None
        self._regular: Array | None = None
        self._pull = 0.0

    @property
    def lost(self) -> bool:
        """Whether a way out of a singularity is being looked for."""
        return self._regular is None and self._scout is not None

    def reset(self) -> None:
        """Forgets the last regular configuration, as when the team is put elsewhere."""
        self._regular, self._pull = None, 0.0
        if self._scout is not None:
            self._scout.forget()

    def relative(self, S: Array) -> float:
        """Regularity relative to the team's best, of S or of anything with its Frobenius norm."""
        return regularity(S) / self._best

    def law_share(self, relative: float) -> float:
        """Share of the law: 1 where regular, 0 at a singularity, once differentiable between."""
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
            if self._scout is None:
                return None
            goal = self._scout.goal(q)
        change = step / RAMP
        self._pull = max(0.0, self._pull - change) if stopped else min(1.0, self._pull + change)
        way = self._team.difference(q, goal)
        return (1.0 - share) * self._settings.recovery_stiffness * self._pull * way

    def damping(self, share: float) -> float:
        """Return the rate [1/s] at which all joints are damped beside the law."""
        return (1.0 - share) * self._settings.recovery_damping
