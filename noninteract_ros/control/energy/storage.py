# SPDX-License-Identifier: Apache-2.0
"""Storage functions of the subtasks and their rates: (32) and (33)."""

from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.decoupling import TaskDynamics, TaskError
from noninteract_ros.control.law.impedance import Impedance


@dataclass(frozen=True, slots=True)
class Energy:
    """Energy of each subtask, shape (number of subtasks,) each.

    Attributes:
        storage: S_i = e_rate' M_i e_rate / 2 + V_i(e) [J].
        rate: dS_i/dt under the law in force and the external torque [W].
        supplied: e_rate' (tau~e_i + f_i), from the environment and from force inputs [W].
        dissipated: e_rate' D_i e_rate [W].
    """

    storage: Array
    rate: Array
    supplied: Array
    dissipated: Array


def energy(
    dynamics: TaskDynamics,
    error: TaskError,
    impedance: Impedance,
    task_acceleration: Array,
    external_torque: Array,
) -> Energy:
    """Return storage (32) and its rate for any law; `rate = supplied - dissipated` is (33).

    Args:
        dynamics: Task dynamics at the state.
        error: Tracking state of the subtasks.
        impedance: Gains.
        task_acceleration: What the law commanded, shape (n,).
        external_torque: tau_e on the joints, shape (n,) [N or N m].
    """
    external = dynamics.decoupled_external_force(external_torque)
    acceleration = task_acceleration - error.reference_acceleration
    momentum_rate = dynamics.multiply_by_inertias(acceleration) + external
    # e_rate' (dM_i/dt) e_rate / 2 = e_rate' C~_i e_rate, since dM_i/dt - 2 C~_i is skew.
    force = momentum_rate + dynamics.coriolis_force(error.e_rate) + impedance.force(error.e)
    kinetic = 0.5 * error.e_rate * dynamics.multiply_by_inertias(error.e_rate)
    return Energy(
        _by_subtask(dynamics, kinetic + impedance.potential(error.e)),
        _by_subtask(dynamics, error.e_rate * force),
        _by_subtask(dynamics, error.e_rate * (external + error.force)),
        _by_subtask(dynamics, impedance.damping * error.e_rate**2),
    )


def _by_subtask(dynamics: TaskDynamics, values: Array) -> Array:
    return np.array([values[part].sum() for part in dynamics.slices])
