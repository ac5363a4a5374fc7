# SPDX-License-Identifier: Apache-2.0
"""The gated law: the natural one, plus sigma times what complete decoupling adds to it.

    a     = a_nat + sigma (a_non - a_nat)
    a_nat = a_d - Lambda^-1 (mu e_rate + nu (D e_rate + h) - f)

Force goals belong to the decoupling, so that whatever they do is paid from the same tank.
"""

from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.decoupling import TaskDynamics, TaskError, acceleration_against
from noninteract_ros.control.law.impedance import Impedance


@dataclass(frozen=True, slots=True)
class Decoupling:
    """What complete decoupling adds to the natural law at a state, the impedance at full grip.

    Attributes:
        acceleration: Task acceleration of the noninteracting law, shape (n,).
        drift: mu e_rate, shape (n,) [N].
        feedback: D e_rate + h(e), shape (n,) [N].
        force: S' Delta = Lambda (a_non - a_nat), shape (n,) [N].
        power: P = e_rate' S' Delta [W].
    """

    acceleration: Array
    drift: Array
    feedback: Array
    force: Array
    power: float


def decoupling(dynamics: TaskDynamics, error: TaskError, impedance: Impedance) -> Decoupling:
    """The decoupling at a state; no solution with Lambda is needed for it."""
    feedback = impedance.feedback(error.e, error.e_rate)
    acceleration = acceleration_against("noninteracting", dynamics, error, feedback)
    drift = dynamics.natural_coriolis_force(error.e_rate)
    force = beyond_natural(dynamics, error, acceleration, drift + feedback)
    return Decoupling(acceleration, drift, feedback, force, float(error.e_rate @ force))


def without_law(dynamics: TaskDynamics, error: TaskError, impedance: Impedance) -> Decoupling:
    """What is left of it where the law is not defined: the feedback, for who feels it."""
    none = np.zeros_like(error.e)
    return Decoupling(none, none, impedance.feedback(error.e, error.e_rate), none, 0.0)


def beyond_natural(
    dynamics: TaskDynamics, error: TaskError, acceleration: Array, resistance: Array
) -> Array:
    """Lambda (a - a_nat), shape (n,) [N], where a_nat = a_d - Lambda^-1 (resistance - f)."""
    wanted = dynamics.multiply_by_inertia(acceleration - error.reference_acceleration)
    return wanted + resistance - error.force


def gated_acceleration(
    dynamics: TaskDynamics, error: TaskError, added: Decoupling, sigma: float, grip: float
) -> Array:
    """Task acceleration of the gated law, shape (n,); that of complete decoupling, if open."""
    complete = added.acceleration
    if sigma == 1.0 and grip == 1.0:
        return complete
    if grip != 1.0:
        complete = acceleration_against("noninteracting", dynamics, error, grip * added.feedback)
    natural = error.reference_acceleration - dynamics.divide_by_inertia(
        added.drift + grip * added.feedback - error.force
    )
    return natural + sigma * (complete - natural)
