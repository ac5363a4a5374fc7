# SPDX-License-Identifier: Apache-2.0
"""Dynamics of a team and its subtasks at a state."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Protocol

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.decoupling import TaskDynamics, task_terms
from noninteract_ros.memo import Memo
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.subtasks.subtask import SubtaskState
from noninteract_ros.team.team import Team, TeamState

DesiredInertias = tuple[Array | None, ...]


@dataclass(frozen=True, slots=True)
class Evaluation:
    """One state.

    Attributes:
        state: Team dynamics.
        task: Subtask values and Jacobians.
        dynamics: Task dynamics.
    """

    state: TeamState
    task: SubtaskState
    dynamics: TaskDynamics


class TeamEvaluator(Protocol):
    """Evaluates states, with matrices over the whole team or without."""

    def evaluate(self, q: Array, v: Array, inertias: DesiredInertias) -> Evaluation:
        """Return everything at a state, with the subtasks' desired inertias."""

    def again(self, seen: Evaluation, inertias: DesiredInertias) -> TaskDynamics:
        """Return task dynamics of the same state with other desired inertias."""


class DenseEvaluator:
    """Matrices over the whole team, for any subtasks.

    Args:
        team: The robots.
        stack: Their subtasks.
    """

    def __init__(self, team: Team, stack: SubtaskStack) -> None:
        self._team, self._stack = team, stack
        self._terms = Memo(task_terms)

    def evaluate(self, q: Array, v: Array, inertias: DesiredInertias) -> Evaluation:
        """Return everything at a state; what does not change is computed once."""
        state = self._team.state(q, v)
        task = self._stack.evaluate(state)
        return Evaluation(state, task, self._dynamics(self._terms, state, task, inertias))

    def again(self, seen: Evaluation, inertias: DesiredInertias) -> TaskDynamics:
        """Return task dynamics of the same state."""
        return self._dynamics(task_terms, seen.state, seen.task, inertias)

    def _dynamics(
        self,
        terms: Callable[..., TaskDynamics],
        state: TeamState,
        task: SubtaskState,
        inertias: DesiredInertias,
    ) -> TaskDynamics:
        matrices = (state.M, state.C, state.g, task.J, task.J_rate)
        return terms(*matrices, self._stack.slices, inertias)


class LazyTeamState(TeamState):
    """State whose matrices are computed when first used.

    Args:
        team: The robots.
        q: Configuration, shape (nq,).
        v: Velocity, shape (n,).
        g: Gravity torque, shape (n,).
    """

    def __init__(self, team: Team, q: Array, v: Array, g: Array) -> None:
        for name, value in (("q", q), ("v", v), ("g", g), ("_team", team)):
            object.__setattr__(self, name, value)

    _team: Team

    def __getattr__(self, name: str) -> object:
        """Compute all fields."""
        if name not in {item.name for item in fields(TeamState)}:
            raise AttributeError(name)
        found = self._team.state(self.q, self.v)
        for item in fields(TeamState):
            object.__setattr__(self, item.name, getattr(found, item.name))
        return getattr(found, name)


class LazySubtaskState(SubtaskState):
    """Subtask values whose Jacobians are computed when first used.

    Args:
        x: Stacked values, shape (size,).
        dynamics: Where the Jacobians come from.
    """

    def __init__(self, x: Array, dynamics: TaskDynamics) -> None:
        object.__setattr__(self, "x", x)
        object.__setattr__(self, "_dynamics", dynamics)

    _dynamics: TaskDynamics

    def __getattr__(self, name: str) -> object:
        """Return the Jacobian or its rate."""
        if name not in ("J", "J_rate"):
            raise AttributeError(name)
        return getattr(self._dynamics, name)
