# SPDX-License-Identifier: Apache-2.0
"""The gated law: the natural one, plus sigma times what complete decoupling adds to it.

    a     = a_nat + sigma (a_non - a_nat)
    a_nat = a_d - Lambda^-1 (mu e_rate + damping D e_rate + nu h - f)

Force goals belong to the decoupling, so that their work is paid from the same tank.
"""

from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.decoupling import TaskDynamics, TaskError, acceleration_against
from noninteract_ros.control.law.impedance import Impedance


@dataclass(frozen=True, slots=True)
class Decoupling:
    """Contribution of complete decoupling to the natural law at a state, with all gates open.

    Attributes:
        acceleration: Task acceleration of the noninteracting law, shape (n,).
        drift: mu e_rate, shape (n,) [N].
        dampers: D e_rate, shape (n,) [N].
        springs: h(e), shape (n,) [N].
        feedback: D e_rate + h(e), shape (n,) [N].
        force: S' Delta = Lambda (a_non - a_nat), shape (n,) [N].
        power: P = e_rate' S' Delta [W].
    """

    acceleration: Array
    drift: Array
    dampers: Array
    springs: Array
    feedback: Array
    force: Array
    power: float

    def resistance(self, nu: float, damping: float) -> Array:
        """Force of springs and dampers behind their gates, shape (n,) [N]."""
        if nu == 1.0 and damping == 1.0:
            return self.feedback
        return damping * self.dampers + nu * self.springs


def decoupling(dynamics: TaskDynamics, error: TaskError, impedance: Impedance) -> Decoupling:
    """Return the decoupling at a state; no solution with Lambda is needed for it."""
    dampers, springs = impedance.damping * error.e_rate, impedance.force(error.e)
    feedback = dampers + springs
    acceleration = acceleration_against("noninteracting", dynamics, error, feedback)
    drift = dynamics.natural_coriolis_force(error.e_rate)
    force = beyond_natural(dynamics, error, acceleration, drift + feedback)
    power = float(error.e_rate @ force)
    return Decoupling(acceleration, drift, dampers, springs, feedback, force, power)


def without_decoupling(
    dynamics: TaskDynamics, error: TaskError, impedance: Impedance
) -> Decoupling:
    """Return springs and dampers alone, for a state at which no decoupling is defined."""
    none = np.zeros_like(error.e)
    dampers, springs = impedance.damping * error.e_rate, impedance.force(error.e)
    return Decoupling(none, none, dampers, springs, dampers + springs, none, 0.0)


def beyond_natural(
    dynamics: TaskDynamics, error: TaskError, acceleration: Array, resistance: Array
) -> Array:
    """Return Lambda (a - a_nat), shape (n,) [N]; a_nat = a_d - Lambda^-1 (resistance - f)."""
    wanted = dynamics.multiply_by_inertia(acceleration - error.reference_acceleration)
    return wanted + resistance - error.force


def gated_acceleration(
    dynamics: TaskDynamics,
    error: TaskError,
    added: Decoupling,
    sigma: float,
    nu: float,
    damping: float = 1.0,
) -> Array:
    """Return the task acceleration of the gated law, (n,); the noninteracting one if open."""
    complete, resistance = added.acceleration, added.resistance(nu, damping)
    if resistance is not added.feedback:
        complete = acceleration_against("noninteracting", dynamics, error, resistance)
    if sigma == 1.0:
        return complete
    natural = error.reference_acceleration - dynamics.divide_by_inertia(
        added.drift + resistance - error.force
    )
    return natural + sigma * (complete - natural)
