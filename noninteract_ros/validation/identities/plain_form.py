# SPDX-License-Identifier: Apache-2.0
"""Torques of the laws in the form of the paper, alpha + Gamma tau~_c, for comparison only."""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.decoupling import TaskDynamics, TaskError
from noninteract_ros.control.law.impedance import Impedance


def block_diagonal(dynamics: TaskDynamics, blocks: tuple[Array, ...]) -> Array:
    """Return the block-diagonal matrix of the subtasks, shape (n, n)."""
    result = np.zeros_like(dynamics.M)
    for part, block in zip(dynamics.slices, blocks, strict=True):
        result[part, part] = block
    return result


def decoupling_matrix(dynamics: TaskDynamics) -> Array:
    """Return Gamma of Theorem 1, shape (n, n): J M^-1 Gamma = blkdiag(M_i^-1)."""
    inverses = tuple(np.linalg.inv(inertia) for inertia in dynamics.inertias)
    return dynamics.MS @ block_diagonal(dynamics, inverses)  # Eq. (16).


def corollary_decoupling_matrix(M: Array, J_1: Array, J_2: Array) -> Array:
    """Return Gamma of Corollary 1 for two subtasks, shape (n, n), corrected (19) and (20)."""

    def null_space(J: Array) -> Array:
        M_inverse_Jt = np.linalg.solve(M, J.T)
        return np.eye(len(M)) - M_inverse_Jt @ np.linalg.solve(J @ M_inverse_Jt, J)  # Eq. (20).

    return np.hstack([null_space(J_2).T @ J_1.T, null_space(J_1).T @ J_2.T])  # Eq. (19).


def task_coriolis(dynamics: TaskDynamics) -> Array:
    """Return C_s = M_s (J M^-1 C - J_rate) S, shape (n, n)."""
    M_s = block_diagonal(dynamics, dynamics.inertias)
    return (
        M_s @ (dynamics.J @ np.linalg.solve(dynamics.M, dynamics.C) - dynamics.J_rate) @ dynamics.S
    )  # Eq. (25).


def subtask_coriolis(dynamics: TaskDynamics) -> tuple[Array, ...]:
    """Return C~_i = S_i' (C S_i + M dS_i/dt), shape (p_i, p_i) each; dM_i/dt - 2 C~_i is skew."""
    S_rate = -dynamics.S @ dynamics.J_rate @ dynamics.S
    mu = dynamics.S.T @ (dynamics.C @ dynamics.S + dynamics.M @ S_rate)
    return tuple(
        np.zeros_like(mu[part, part]) if constant else mu[part, part]
        for part, constant in zip(dynamics.slices, dynamics.constant, strict=True)
    )


def paper_subtask_coriolis(dynamics: TaskDynamics) -> tuple[Array, ...]:
    """Return C_s,ii of each subtask, as kept by Theorem 2, shape (p_i, p_i) each."""
    C_s = task_coriolis(dynamics)
    return tuple(C_s[part, part] for part in dynamics.slices)


def state_feedback(dynamics: TaskDynamics, v: Array, kept: tuple[Array, ...]) -> Array:
    """Return alpha = Gamma (C_s - blkdiag(kept)) J v + g, shape (n,) [N or N m]."""
    surplus = task_coriolis(dynamics) - block_diagonal(dynamics, kept)
    return decoupling_matrix(dynamics) @ surplus @ dynamics.J @ v + dynamics.g  # Eq. (26).


def subtask_force(
    dynamics: TaskDynamics, error: TaskError, impedance: Impedance, kept: tuple[Array, ...]
) -> Array:
    """Return tau~_c of all subtasks, shape (n,) [N; N m]."""
    M_s = block_diagonal(dynamics, dynamics.inertias)
    C_kept = block_diagonal(dynamics, kept)
    return (
        M_s @ error.reference_acceleration
        + C_kept @ error.reference_velocity
        - impedance.damping * error.e_rate
        - impedance.force(error.e)
        + error.force
    )  # Eq. (30).


def plain_torque(
    dynamics: TaskDynamics,
    v: Array,
    error: TaskError,
    impedance: Impedance,
    kept: tuple[Array, ...],
) -> Array:
    """Return alpha + Gamma tau~_c, shape (n,) [N or N m].

    Args:
        dynamics: Task dynamics at the state.
        v: Joint velocity, shape (n,).
        error: Tracking state of the subtasks.
        impedance: Gains.
        kept: Coriolis matrices of the closed loops: `subtask_coriolis` for the corrected law,
            `paper_subtask_coriolis` for the paper's.
    """
    return state_feedback(dynamics, v, kept) + decoupling_matrix(dynamics) @ subtask_force(
        dynamics, error, impedance, kept
    )  # Eq. (7).


def natural_torque(dynamics: TaskDynamics, error: TaskError, impedance: Impedance) -> Array:
    """Return J' (Lambda a_d + mu v_d - D e_rate - h(e) + f) + g, shape (n,) [N or N m]."""
    S_rate = -dynamics.S @ dynamics.J_rate @ dynamics.S
    mu = dynamics.S.T @ (dynamics.C @ dynamics.S + dynamics.M @ S_rate)
    force = (
        dynamics.inertia @ error.reference_acceleration
        + mu @ error.reference_velocity
        - impedance.damping * error.e_rate
        - impedance.force(error.e)
        + error.force
    )
    return dynamics.J.T @ force + dynamics.g
