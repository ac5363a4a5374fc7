# SPDX-License-Identifier: Apache-2.0
"""Stack of all subtasks of a team: equation (6) and assumptions 1 to 3."""

from collections.abc import Sequence

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import SubtaskError
from noninteract_ros.memo import Memo
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.subtask import Subtask, SubtaskState
from noninteract_ros.team.team import Team, TeamState

_RANK_TRIALS = 4


class SubtaskStack:
    """Stacked outputs of the whole team, which leave no internal dynamics.

    Args:
        team: The robots.
        subtasks: Subtasks with different names, whose dimensions add up to that of the team.

    Attributes:
        subtasks: Subtasks, in order.
        names: Names of the subtasks.
        layout: Layout of the stacked value.
        slices: Slice of each subtask in a stacked velocity, error or force.
        value_slices: Slice of each subtask in a stacked value.

    Raises:
        SubtaskError: Assumption 1, 2 or 3 does not hold; the text gives the dimensions.
    """

    def __init__(self, team: Team, subtasks: Sequence[Subtask]) -> None:
        self.subtasks = tuple(subtasks)
        self.names = tuple(subtask.name for subtask in subtasks)
        if len(set(self.names)) != len(self.names):
            raise SubtaskError(f"each subtask needs a unique name, found {list(self.names)}")
        self._check_count(team.n)
        self.layout = Layout.joined([subtask.layout for subtask in subtasks])
        self.slices = _slices([subtask.dim for subtask in subtasks])
        self.value_slices = _slices([subtask.size for subtask in subtasks])
        self._stacked, self._stacked_rate = Memo(_stack), Memo(_stack)
        self._singular = [
            task
            for task in self.subtasks
            if type(task).singularity_distance is not Subtask.singularity_distance
        ]
        self._check_rank(team)

    def evaluate(self, state: TeamState) -> SubtaskState:
        """Return stacked value (size,), Jacobian (n, n) and Jacobian rate (n, n)."""
        parts = [subtask.evaluate(state) for subtask in self.subtasks]
        return SubtaskState(
            np.concatenate([part.x for part in parts]),
            self._stacked(*(part.J for part in parts)),
            self._stacked_rate(*(part.J_rate for part in parts)),
        )

    def singularity_distance(self, state: TeamState) -> float:
        """Return the least `Subtask.singularity_distance`; 1 if no subtask has singular states."""
        return min((task.singularity_distance(state) for task in self._singular), default=1.0)

    def difference(self, x: Array, x_d: Array) -> Array:
        """Return the error of stacked values with respect to others, shape (n,).

        See `Layout.difference`.
        """
        return self.layout.difference(x, x_d)

    def _check_count(self, n: int) -> None:
        """Check assumption 2; fewer coordinates would leave internal dynamics, assumption 1."""
        total = sum(subtask.dim for subtask in self.subtasks)
        if total == n:
            return
        terms = " + ".join(f"{subtask.dim} ({subtask.name})" for subtask in self.subtasks)
        broken = "1 and 2 (internal dynamics)" if total < n else "2 (too many goals)"
        raise SubtaskError(
            f"assumption {broken}: the subtasks have {terms} = {total} coordinates, "
            f"the team has {n}"
        )

    def _jacobian(self, team: Team, step: Array) -> Array:
        return self.evaluate(team.state(team.integrate(team.q0, step), np.zeros(team.n))).J

    def _check_rank(self, team: Team) -> None:
        """Check assumption 3 structurally: full rank at one configuration at least."""
        rng = np.random.default_rng(0)
        steps = [np.zeros(team.n), *rng.uniform(-0.5, 0.5, (_RANK_TRIALS, team.n))]
        Js = [self._jacobian(team, step) for step in steps]
        ranks = [int(np.linalg.matrix_rank(J)) for J in Js]
        if max(ranks) == team.n:
            return
        best = Js[int(np.argmax(ranks))]
        own = ", ".join(
            f"{name} {np.linalg.matrix_rank(best[part])} of {part.stop - part.start}"
            for name, part in zip(self.names, self.slices, strict=True)
        )
        raise SubtaskError(
            f"assumption 3: the stacked Jacobian has rank {max(ranks)} of {team.n} "
            f"(by subtask: {own}); the subtasks depend on each other"
        )


def _slices(sizes: Sequence[int]) -> tuple[slice, ...]:
    ends = np.cumsum(sizes).tolist()
    return tuple(slice(end - size, end) for end, size in zip(ends, sizes, strict=True))


def _stack(*parts: Array) -> Array:
    return np.concatenate(parts)
