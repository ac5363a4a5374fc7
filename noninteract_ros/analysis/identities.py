# SPDX-License-Identifier: Apache-2.0
"""What the law claims of itself, measured at random states of a team."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from noninteract_ros.analysis.checks import Check, at_most
from noninteract_ros.arrays import Array
from noninteract_ros.control import decoupling, plain_form
from noninteract_ros.control.decoupling import TaskDynamics, TaskError
from noninteract_ros.control.impedance import Impedance
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team, TeamState

SPREAD = 0.2  # [m or rad] how far from the initial configuration the states are taken
SPEED = 1.0  # [m/s or rad/s] bound of their velocities
ERROR = 0.2  # [SI] bound of their errors, desired accelerations and forces
STEP = 1e-5  # [s] of the central differences
ROUNDING = 1e-8  # limit of what only rounding may keep from zero, relative
DIFFERENCING = 1e-5  # limit of what central differences may keep from zero, relative

PlainForm = Callable[[TaskDynamics, Array, TaskError, Impedance], Array]


def _corrected(dynamics: TaskDynamics, v: Array, error: TaskError, gains: Impedance) -> Array:
    kept = plain_form.subtask_coriolis(dynamics)
    return plain_form.plain_torque(dynamics, v, error, gains, kept)


def _printed(dynamics: TaskDynamics, v: Array, error: TaskError, gains: Impedance) -> Array:
    kept = plain_form.paper_subtask_coriolis(dynamics)
    return plain_form.plain_torque(dynamics, v, error, gains, kept)


def _natural(dynamics: TaskDynamics, v: Array, error: TaskError, gains: Impedance) -> Array:
    return plain_form.natural_torque(dynamics, error, gains)


PLAIN_FORMS: dict[str, PlainForm] = {
    "noninteracting": _corrected,
    "natural": _natural,
    "paper": _printed,
}


@dataclass(frozen=True)
class LawProbe:
    """A team under the law, to be looked at in any state.

    Attributes:
        team: The robots.
        stack: Their subtasks.
        impedance: Gains of all subtasks.
    """

    team: Team
    stack: SubtaskStack
    impedance: Impedance

    def dynamics(self, state: TeamState) -> TaskDynamics:
        """Task dynamics at a state."""
        task = self.stack.evaluate(state)
        return decoupling.task_dynamics(state, task, self.stack.slices, self.impedance.inertias)

    def along(self, state: TeamState, dt: float) -> TaskDynamics:
        """Task dynamics `dt` seconds further along the velocity of a state."""
        q = self.team.integrate(state.q, dt * state.v)
        return self.dynamics(self.team.state(q, state.v))

    def random_states(
        self, count: int, seed: int
    ) -> Iterator[tuple[TeamState, TaskDynamics, TaskError]]:
        """States near the initial one, with errors and desired motions that fit them."""
        rng = np.random.default_rng(seed)
        n = self.team.n
        for _ in range(count):
            q = self.team.integrate(self.team.q0, rng.uniform(-SPREAD, SPREAD, n))
            state = self.team.state(q, rng.uniform(-SPEED, SPEED, n))
            dynamics = self.dynamics(state)
            e, e_rate, acceleration, force = rng.uniform(-ERROR, ERROR, (4, n))
            desired = dynamics.J @ state.v - e_rate
            yield state, dynamics, TaskError(e, e_rate, desired, acceleration, force)


def identities(probe: LawProbe, samples: int, seed: int) -> list[Check]:
    """The largest residual of each identity over random states, against its limit."""
    exact: dict[str, float] = {}
    differenced: dict[str, float] = {}
    for state, dynamics, error in probe.random_states(samples, seed):
        _keep_largest(exact, _exact(probe, state, dynamics, error))
        _keep_largest(differenced, _differenced(probe, state, dynamics))
    return [
        *(at_most(name, value, ROUNDING, "relative") for name, value in exact.items()),
        *(at_most(name, value, DIFFERENCING, "relative") for name, value in differenced.items()),
    ]


def _keep_largest(largest: dict[str, float], found: Mapping[str, float]) -> None:
    for name, value in found.items():
        # NaN must stay and fail; a comparison would lose it.
        largest[name] = float(np.maximum(largest.get(name, 0.0), value))


def _exact(
    probe: LawProbe, state: TeamState, dynamics: TaskDynamics, error: TaskError
) -> dict[str, float]:
    residuals = {"J M^-1 Gamma = blkdiag(M_i^-1)": decoupling_residual(dynamics)}
    for law in PLAIN_FORMS:
        value = torque_residual(probe, state, dynamics, error, law)
        residuals[f"both forms of the torque, {law}"] = value
    return residuals


def _differenced(probe: LawProbe, state: TeamState, dynamics: TaskDynamics) -> dict[str, float]:
    before, after = probe.along(state, -STEP), probe.along(state, STEP)
    M_rate, J_rate = _rate(before.M, after.M), _rate(before.J, after.J)
    residuals = {
        "dM/dt = C + C'": _relative(M_rate - state.C - state.C.T, state.C, state.M),
        "dJ/dt": _relative(J_rate - dynamics.J_rate, dynamics.J_rate, dynamics.J),
    }
    kept = plain_form.subtask_coriolis(dynamics)
    for i, name in enumerate(probe.stack.names):
        rate = _rate(before.inertias[i], after.inertias[i])
        residuals[f"dM_i/dt - 2 C~_i is skew, {name}"] = _relative(
            rate - kept[i] - kept[i].T, kept[i], dynamics.inertias[i]
        )
    return residuals


def decoupling_residual(dynamics: TaskDynamics) -> float:
    """How far J M^-1 Gamma is from blkdiag(M_i^-1), relative: Theorem 1, (16)."""
    inverses = tuple(np.linalg.inv(inertia) for inertia in dynamics.inertias)
    wanted = plain_form.block_diagonal(dynamics, inverses)
    found = dynamics.J @ np.linalg.solve(dynamics.M, plain_form.decoupling_matrix(dynamics))
    return _relative(found - wanted, wanted)


def torque_residual(
    probe: LawProbe, state: TeamState, dynamics: TaskDynamics, error: TaskError, law: str
) -> float:
    """Difference of alpha + Gamma tau~_c and inverse dynamics of the same law, relative."""
    plain = PLAIN_FORMS[law](dynamics, state.v, error, probe.impedance)
    task_acceleration = decoupling.commanded_acceleration(law, dynamics, error, probe.impedance)
    wanted = dynamics.joint_acceleration(state.v, task_acceleration)
    fast = probe.team.inverse_dynamics(state.q, state.v, wanted)
    return _relative(fast - plain, plain)


def _rate(before: Array, after: Array) -> Array:
    return (after - before) / (2.0 * STEP)


def _relative(residual: Array, *scales: Array) -> float:
    """Largest element of a residual by the largest one of what it is made of."""
    scale = sum(np.abs(array).max() for array in scales)
    return float(np.abs(residual).max() / scale)
