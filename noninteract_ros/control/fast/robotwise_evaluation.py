# SPDX-License-Identifier: Apache-2.0
"""Detection and evaluation of teams with the structure of `robotwise_dynamics`."""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.fast.coordinates import Roles, coordinates, value_indices
from noninteract_ros.control.fast.kernels.array_parts import MIXING_ARRAYS
from noninteract_ros.control.fast.kernels.robots import robot_terms
from noninteract_ros.control.fast.kernels.subtask_values import Means, mixing_terms
from noninteract_ros.control.fast.robot_terms import RobotTerms
from noninteract_ros.control.fast.robotwise_dynamics import RobotwiseDynamics
from noninteract_ros.control.law.decoupling import TaskDynamics
from noninteract_ros.control.law.team_dynamics import (
    DesiredInertias,
    Evaluation,
    LazySubtaskState,
    LazyTeamState,
)
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team


class RobotwiseEvaluator:
    """Evaluator of a team whose subtasks are a mean, the edges of a tree, and chosen joints.

    Args:
        team: The robots.
        stack: Subtasks of the team.
        roles: Roles of the subtasks, from `Roles.of`.
    """

    def __init__(self, team: Team, stack: SubtaskStack, roles: Roles) -> None:
        self._team, self._size = team, stack.layout.size
        self._robots = RobotTerms(team)
        self._coordinates = coordinates(team, stack, roles, self._robots)
        values, self._joints = value_indices(stack)
        self._joints_in_q = np.array(roles.in_q, dtype=np.intp)
        rows, rotates = np.array(roles.rows, dtype=np.intp), roles.rotation is not None
        chosen = self._chosen_rows(roles)
        self._tools = self._robots.tools(rows, rotates, roles.offsets, chosen)
        self._means = Means(roles.weights, values, roles.framed_points, roles.framed_rotations)
        self._evaluate(team.q0, np.zeros(team.n), (None,) * len(stack.subtasks))[1].warm_up()

    @classmethod
    def of(cls, team: Team, stack: SubtaskStack) -> "RobotwiseEvaluator | None":
        """Return the evaluator of a team; None if its subtasks do not have this structure."""
        roles = Roles.of(team, stack)
        return cls(team, stack, roles) if roles is not None else None

    def _chosen_rows(self, roles: Roles) -> Array:
        """Return T of the chosen joints and the padding, zero elsewhere, shape (N, m, m)."""
        count, m, h = len(self._team.robots), self._robots.m, self._coordinates.h
        T = np.tile(np.eye(m), (count, 1, 1))
        T[:, :h] = 0.0
        flat = T.reshape(-1, m)
        for slot, joint in zip(self._coordinates.chosen, roles.in_v, strict=True):
            flat[slot] = 0.0
            flat[slot, self._robots.joints[joint] % m] = 1.0
        return T

    def evaluate(self, q: Array, v: Array, inertias: DesiredInertias) -> Evaluation:
        """Evaluate all terms at a state, with the subtasks' desired inertias."""
        v = np.array(v)  # A read-only array would compile another specialisation.
        x, dynamics = self._evaluate(q, v, inertias)
        state = LazyTeamState(self._team, q, v, dynamics.g)
        return Evaluation(state, LazySubtaskState(x, dynamics), dynamics)

    def _evaluate(
        self, q: Array, v: Array, inertias: DesiredInertias
    ) -> tuple[Array, RobotwiseDynamics]:
        """Return values and task dynamics at a state."""
        plan, poses, h = self._coordinates.plan, self._robots.poses, self._coordinates.h
        blocks, g = self._robots.evaluate(q, v)
        robot_terms(plan, self._tools, poses, blocks, v)
        mixers, G_inverse = np.zeros((MIXING_ARRAYS, blocks.shape[1], h, h)), np.empty((1, h, h))
        x = np.empty(self._size)
        x[self._joints] = q[self._joints_in_q]
        mixing_terms(plan, self._tools, self._means, poses, mixers, G_inverse, x)
        return x, RobotwiseDynamics(self._coordinates, blocks, mixers, G_inverse, g, inertias)

    def again(self, seen: Evaluation, inertias: DesiredInertias) -> TaskDynamics:
        """Return the task dynamics of the same state with other desired inertias."""
        return self._evaluate(seen.state.q, seen.state.v, inertias)[1]
