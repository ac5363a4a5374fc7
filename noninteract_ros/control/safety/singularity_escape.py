# SPDX-License-Identifier: Apache-2.0
"""Search for a regular configuration, for a team that starts in a singularity."""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.decoupling import inverse
from noninteract_ros.control.safety.singularity import joint_range, regularity
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team

STRIDE = 0.01  # [m or rad] largest change of a joint in one step of the search
FOLLOW = 0.02  # share of the way to what was found that the goal goes in a tick
ENOUGH = 1.3  # times the regularity at which the law is whole again


class SingularityEscape:
    """Random search for a regular configuration near a singular one, one trial per tick.

    Small random steps of all joints are kept where they are more regular, within joint limits; the
    goal follows what was found, smoothly. The steps are the same in every run.

    Args:
        team: The robots.
        stack: Their subtasks.
        best: Regularity that counts as 1.
        regular: Relative regularity from which on the law is whole.
    """

    def __init__(self, team: Team, stack: SubtaskStack, best: float, regular: float) -> None:
        self._team, self._stack, self._best = team, stack, best
        self._enough = min(1.0, ENOUGH * regular)
        self._lower, self._upper = joint_range(team)
        self._still = np.zeros(team.n)
        self.reset()

    def reset(self) -> None:
        """Have the next search start where the team is then."""
        self._rng = np.random.default_rng(0)
        self._found: tuple[Array, float] | None = None
        self._goal: Array | None = None

    def goal(self, q: Array) -> Array:
        """Return where to go, shape (nq,), after one more trial.

        Args:
            q: Where the team is, shape (nq,); the first search begins there.
        """
        found, value = self._found or (q, self._measure(q))
        if value < self._enough:
            joints = self._team.joints_from_configuration(found)
            tried = joints + self._rng.uniform(-STRIDE, STRIDE, self._team.n)
            # A joint that is beyond its range already is not led further out.
            low, high = np.minimum(self._lower, joints), np.maximum(self._upper, joints)
            trial = self._team.configuration_from_joints(np.clip(tried, low, high))
            if (better := self._measure(trial)) > value:
                found, value = trial, better
        self._found = (found, value)
        goal = q if self._goal is None else self._goal
        way = FOLLOW * self._team.difference(goal, found)
        self._goal = self._team.integrate(goal, way)
        return self._goal

    def _measure(self, q: Array) -> float:
        state = self._team.state(q, self._still)
        relative = regularity(inverse(self._stack.evaluate(state).J)) / self._best
        return min(relative, self._stack.singularity_distance(state))
