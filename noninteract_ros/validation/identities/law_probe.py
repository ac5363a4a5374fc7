# SPDX-License-Identifier: Apache-2.0
"""Random states of a team for measuring the identities of the law."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.law import decoupling
from noninteract_ros.control.law.decoupling import TaskDynamics, TaskError
from noninteract_ros.control.law.impedance import Impedance
from noninteract_ros.control.safety.settings import SafetySettings
from noninteract_ros.control.safety.singularity import best_regularity, joint_range, regularity
from noninteract_ros.errors import TeamError
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team, TeamState

REGULAR = SafetySettings().singularity_begin  # relative regularity; lower values change the law
SPEED = 1.0  # [m/s or rad/s] bound of joint velocities
ERROR = 0.2  # [SI] bound of errors, desired accelerations and forces
MAX_REJECTIONS = 1000  # consecutive rejected draws of a team that is singular everywhere
MAX_JUMP = 10.0  # times the way that a subtask's velocity leads in a step; beyond, its value jumps

STEP = 5e-4  # [s] between the states of a difference quotient
OFFSETS = (-3, -2, -1, 1, 2, 3)  # steps at which they stand
WEIGHTS = (-1 / 60, 9 / 60, -45 / 60, 45 / 60, -9 / 60, 1 / 60)  # central, of order 6


@dataclass(frozen=True)
class Sample:
    """Random state with its neighbours along the velocity.

    Attributes:
        state: Team dynamics.
        dynamics: Task dynamics.
        error: Random tracking state.
        neighbours: Task dynamics at the `OFFSETS`, on the straight line along the velocity.
    """

    state: TeamState
    dynamics: TaskDynamics
    error: TaskError
    neighbours: tuple[TaskDynamics, ...]

    def rate(self, term: Callable[[TaskDynamics], Array]) -> Array:
        """Return the time derivative of a term along the velocity, to order 6 in the step."""
        values = np.array([term(dynamics) for dynamics in self.neighbours])
        return np.tensordot(WEIGHTS, values, axes=1) / STEP


class LawProbe:
    """Team and gains at random states.

    Args:
        team: The robots.
        stack: Their subtasks.
        impedance: Gains of all subtasks.

    Attributes:
        rejected: Number of rejected states so far.
    """

    def __init__(self, team: Team, stack: SubtaskStack, impedance: Impedance) -> None:
        self.team, self.stack, self.impedance = team, stack, impedance
        self.rejected = 0
        self._least = REGULAR * best_regularity(team, stack)
        self._range = joint_range(team)

    def dynamics(self, state: TeamState) -> TaskDynamics:
        """Return the task dynamics at a state."""
        task = self.stack.evaluate(state)
        return decoupling.task_dynamics(state, task, self.stack.slices, self.impedance.inertias)

    def samples(self, count: int, seed: int) -> Iterator[Sample]:
        """Yield random states in the whole range of the joints, away from singularities.

        States are rejected if the regularity of the task Jacobian is below `REGULAR`, relative to
        the team's best, or if a subtask's value jumps along the velocity, as the mean of two
        opposite orientations does.

        Raises:
            TeamError: No such state is found.
        """
        rng = np.random.default_rng(seed)
        for _ in range(count):
            for _ in range(MAX_REJECTIONS):
                if (sample := self._draw(rng)) is not None:
                    break
                self.rejected += 1
            else:
                text = f"singular at each of {MAX_REJECTIONS} random states of its joints' range"
                raise TeamError(text)
            yield sample

    def _draw(self, rng: np.random.Generator) -> Sample | None:
        n = self.team.n
        q = self.team.configuration_from_joints(rng.uniform(*self._range))
        state = self.team.state(q, rng.uniform(-SPEED, SPEED, n))
        dynamics = self.dynamics(state)
        e, e_rate, acceleration, force = rng.uniform(-ERROR, ERROR, (4, n))
        if (
            regularity(dynamics.S) < self._least
            or self.stack.singularity_distance(state) < REGULAR
        ):
            return None
        x_rate = dynamics.J @ state.v
        neighbours = [
            self.team.state(self.team.integrate(q, offset * STEP * state.v), state.v)
            for offset in OFFSETS
        ]
        if self._jumps(neighbours, x_rate):
            return None
        error = TaskError(e, e_rate, x_rate - e_rate, acceleration, force)
        return Sample(state, dynamics, error, tuple(map(self.dynamics, neighbours)))

    def _jumps(self, neighbours: Sequence[TeamState], x_rate: Array) -> bool:
        """Return True if a value moves much further than its velocity between the neighbours."""
        first, *_, last = (self.stack.evaluate(state).x for state in neighbours)
        distance = np.abs(self.stack.difference(last, first))
        return bool(
            distance.max() > MAX_JUMP * (OFFSETS[-1] - OFFSETS[0]) * STEP * np.abs(x_rate).max()
        )
