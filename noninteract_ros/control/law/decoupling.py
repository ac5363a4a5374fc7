# SPDX-License-Identifier: Apache-2.0
"""THE LAW: noninteracting control of a team's subtasks.

Two forms of the same torque. The plain one is the paper's, with Gamma and alpha, equation (7);
the fast one commands a task acceleration and lets inverse dynamics find the torque. Symbols are
those of docs/derivations.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.impedance import Impedance
from noninteract_ros.subtasks.subtask import SubtaskState
from noninteract_ros.team.team import TeamState

LAWS = ("energy_gated", "noninteracting", "natural", "paper")
# On constant inertias they are the same law, as long as the gates of the first are open.
DECOUPLING_LAWS = ("energy_gated", "noninteracting", "paper")


@dataclass(frozen=True, slots=True)
class TaskDynamics:
    """The team's dynamics seen through its subtasks.

    Attributes:
        M: Team inertia, shape (n, n).
        C: Team Coriolis matrix, shape (n, n).
        g: Gravity torque, shape (n,).
        J: Stacked Jacobian, shape (n, n).
        J_rate: Its rate, shape (n, n).
        S: Inverse of J, shape (n, n); its column blocks are S_i.
        MS: M S, shape (n, n).
        inertia: Natural task inertia Lambda = S' M S, shape (n, n).
        slices: Coordinates of each subtask.
        inertias: M_i of each decoupled subtask, shape (p_i, p_i).
        constant: True where M_i was asked for as a constant (remark 2); then its C~_i is zero.
    """

    M: Array
    C: Array
    g: Array
    J: Array
    J_rate: Array
    S: Array
    MS: Array
    inertia: Array
    slices: tuple[slice, ...]
    inertias: tuple[Array, ...]
    constant: tuple[bool, ...]

    @property
    def inverse_sizes(self) -> Array:
        """Array with the Frobenius norm of S."""
        return self.S

    def velocity(self, v: Array) -> Array:
        """Return J v, shape (n,)."""
        return self.J @ v

    def acceleration_of(self, v: Array, joint_acceleration: Array) -> Array:
        """Return the task acceleration J a + J_rate v of a joint acceleration, shape (n,)."""
        return self.J @ joint_acceleration + self.J_rate @ v

    def joint_acceleration(self, v: Array, task_acceleration: Array) -> Array:
        """Return the joint acceleration S (a - J_rate v) of a task acceleration, shape (n,)."""
        return self.S @ (task_acceleration - self.J_rate @ v)

    def torque(self, v: Array, joint_acceleration: Array) -> Array:
        """Return M a + C v + g, shape (n,) [N or N m]."""
        return self.M @ joint_acceleration + self.C @ v + self.g

    def coriolis_force(self, e_rate: Array) -> Array:
        """Return C~_i e_rate_i of every subtask, C~_i = S_i' (C S_i + M dS_i/dt), shape (n,)."""
        U = _spread_by_subtask(self, e_rate)
        W = self.C @ U - self.MS @ (self.J_rate @ U)  # dS/dt = -S J_rate S
        blocks = self.S.T @ W
        force = np.zeros_like(e_rate)
        for i, part in enumerate(self.slices):
            if not self.constant[i]:
                force[part] = blocks[part, i]
        return force

    def natural_coriolis_force(self, e_rate: Array) -> Array:
        """Return mu e_rate with mu = S' (C S + M dS/dt), shape (n,)."""
        u = self.S @ e_rate
        return self.S.T @ (self.C @ u - self.MS @ (self.J_rate @ u))

    def force_of(self, torque: Array) -> Array:
        """Return S' tau, shape (n,) [N]: the forces on the subtasks of a joint torque."""
        return self.S.T @ torque

    def torque_of(self, force: Array) -> Array:
        """Return J' f, shape (n,) [N or N m]: the joint torque of forces on the subtasks."""
        return self.J.T @ force

    def multiply_by_inertia(self, acceleration: Array) -> Array:
        """Return Lambda a, shape (n,)."""
        return self.inertia @ acceleration

    def divide_by_inertia(self, force: Array) -> Array:
        """Return Lambda^-1 f, shape (n,)."""
        return np.linalg.solve(self.inertia, force)

    def divide_by_inertias(self, force: Array) -> Array:
        """Return M_i^-1 f_i of every subtask, shape (n,)."""
        result = np.empty_like(force)
        for part, inertia in zip(self.slices, self.inertias, strict=True):
            result[part] = np.linalg.solve(inertia, force[part])
        return result

    def multiply_by_inertias(self, acceleration: Array) -> Array:
        """Return M_i a_i of every subtask, shape (n,)."""
        result = np.empty_like(acceleration)
        for part, inertia in zip(self.slices, self.inertias, strict=True):
            result[part] = inertia @ acceleration[part]
        return result

    def decoupled_external_force(self, external_torque: Array) -> Array:
        """Return tau~e = Gamma^-1 tau_e = M_s J M^-1 tau_e, shape (n,) [N]."""
        return self.multiply_by_inertias(self.acceleration_under(external_torque))

    def acceleration_under(self, torque: Array) -> Array:
        """Return J M^-1 tau, shape (n,): the task acceleration that a joint torque adds."""
        return self.J @ np.linalg.solve(self.M, torque)


@dataclass(frozen=True, slots=True)
class TaskError:
    """Tracking state of all subtasks, stacked, shape (n,) each.

    Attributes:
        e: x - x_d; for rotations log(R R_d').
        e_rate: Velocity error dx/dt - dx_d/dt; for rotations omega - omega_d.
        reference_velocity: Desired velocity.
        reference_acceleration: Desired acceleration.
        force: Force input of the sources, added to (30), remark 1.
        goal: Force that the subtasks are to press with, added like it; None without any.
    """

    e: Array
    e_rate: Array
    reference_velocity: Array
    reference_acceleration: Array
    force: Array
    goal: Array | None = None


def task_dynamics(
    state: TeamState,
    task: SubtaskState,
    slices: tuple[slice, ...],
    desired_inertias: Sequence[Array | None],
) -> TaskDynamics:
    """Return the terms that every law shares, at a state; see `task_terms`."""
    terms = (state.M, state.C, state.g, task.J, task.J_rate)
    return task_terms(*terms, slices, desired_inertias)


def task_terms(
    M: Array,
    C: Array,
    g: Array,
    J: Array,
    J_rate: Array,
    slices: tuple[slice, ...],
    desired_inertias: Sequence[Array | None],
) -> TaskDynamics:
    """Return the terms that every law shares, from the team's own."""
    S = inverse(J)
    MS = M @ S
    inertia = S.T @ MS
    inertias = tuple(
        inertia[part, part] if desired is None else np.diag(desired)  # Remark 2.
        for part, desired in zip(slices, desired_inertias, strict=True)
    )
    constant = tuple(desired is not None for desired in desired_inertias)
    return TaskDynamics(M, C, g, J, J_rate, S, MS, inertia, slices, inertias, constant)


def inverse(J: Array) -> Array:
    """Return J^-1, (n, n); of an exactly singular J that of a neighbour, with large entries.

    Near a singularity callers check `singularity.regularity` first.
    """
    try:
        return np.linalg.inv(J)
    except np.linalg.LinAlgError:
        size = float(np.abs(J).max()) or 1.0
        return np.linalg.inv(J + 1e-9 * size * np.eye(len(J)))


def commanded_acceleration(
    law: str, dynamics: TaskDynamics, error: TaskError, impedance: Impedance
) -> Array:
    """Return the task acceleration that a law asks for, shape (n,): the fast form.

    Of `energy_gated` it is what its open gates give; `gated_law` has the others.

    Args:
        law: One of `LAWS`.
        dynamics: Task dynamics at the state.
        error: Tracking state of the subtasks.
        impedance: Gains.
    """
    return acceleration_against(law, dynamics, error, impedance.feedback(error.e, error.e_rate))


def acceleration_against(
    law: str, dynamics: TaskDynamics, error: TaskError, feedback: Array
) -> Array:
    """Return the same where D e_rate + h(e), or the share of it in force, is known, shape (n,)."""
    pull = feedback - error.force
    if error.goal is not None:
        pull = pull - error.goal
    if law == "natural":
        drift = dynamics.natural_coriolis_force(error.e_rate)
        return error.reference_acceleration - dynamics.divide_by_inertia(drift + pull)
    if law == "paper":
        drift = paper_coriolis_force(dynamics, error.e_rate)
    else:
        drift = dynamics.coriolis_force(error.e_rate)
    return error.reference_acceleration - dynamics.divide_by_inertias(drift + pull)


def paper_coriolis_force(dynamics: TaskDynamics, e_rate: Array) -> Array:
    """Return C_s,ii e_rate_i of every subtask, as Theorem 2 has it, shape (n,)."""
    U = _spread_by_subtask(dynamics, e_rate)
    blocks = dynamics.J @ np.linalg.solve(dynamics.M, dynamics.C @ U) - dynamics.J_rate @ U
    force = np.empty_like(e_rate)
    for i, part in enumerate(dynamics.slices):
        force[part] = dynamics.inertias[i] @ blocks[part, i]  # Eq. (25).
    return force


def _spread_by_subtask(dynamics: TaskDynamics, e_rate: Array) -> Array:
    """Return columns S_i e_rate_i, shape (n, number of subtasks)."""
    columns = np.zeros((len(e_rate), len(dynamics.slices)))
    for i, part in enumerate(dynamics.slices):
        columns[part, i] = e_rate[part]
    return dynamics.S @ columns
