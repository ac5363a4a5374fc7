# SPDX-License-Identifier: Apache-2.0
"""Equivalent external force of the zero-order hold of the torque.

The law computes tau_k at tick k. The team holds it until tick k + 1, where the law commands
tau_k+1. A continuous law would move from one to the other, so that on average half of the change
is missing. For the subtasks this is an additional external force in (29), of first order in the
tick:

    tau~_i = -1/2 M_i J_i M^-1 (tau_k+1 - tau_k)

The force and all bounds derived from it are computed from the recorded torques and decrease with
the tick. They are no free tolerances, which could hide coupling of subtasks or energy generated
by a law.
In the scenario planar_arms, without other errors, it explains the balance (33) of either subtask
to 2 %.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.decoupling import task_dynamics
from noninteract_ros.control.law.impedance import Impedance, stack_impedance
from noninteract_ros.reporting.recording.recorded import Recorded

OVERSHOOT = 2.0  # largest deflection by a step force over the static one, for a damped loop


@dataclass(frozen=True)
class HoldForce:
    """Equivalent force of the zero-order hold at some states of a run.

    Attributes:
        t: Time of the run, shape (m,) [s].
        force: Force on the coordinates of all subtasks, shape (m, n) [N; N m].
    """

    t: Array
    force: Array


def impedance_of(recorded: Recorded) -> Impedance:
    """Return the gains of a run's scenario."""
    settings = [spec.impedance for spec in recorded.scenario.subtasks.values()]
    return stack_impedance(recorded.stack.subtasks, settings)


def telemetry_rows(recorded: Recorded, count: int | None = None) -> NDArray[np.intp]:
    """Return the states with telemetry among the first `count` states."""
    general = recorded.scenario.general
    period = max(1, round(general.rate / general.telemetry_rate))
    return np.flatnonzero(recorded.ticks[:count] % period == 0)


def recorded_hold_force(recorded: Recorded) -> HoldForce:
    """Return the hold force of a run in lockstep.

    The effort of a state is the torque held until then; that of the next state is the torque
    commanded at this one. The force is zero at the first and the last state, where it is unknown.
    """
    changes = np.zeros_like(recorded.v)
    changes[1:-1] = np.diff(recorded.torque[1:], axis=0)
    rows = telemetry_rows(recorded)
    force = hold_force(recorded, recorded.q[rows], recorded.v[rows], changes[rows])
    return HoldForce(recorded.t[rows], force)


def hold_force(recorded: Recorded, q: Array, v: Array, changes: Array) -> Array:
    """Return the hold force for torque changes (m, n) at q (m, nq), v (m, n), shape (m, n)."""
    impedance = impedance_of(recorded)
    if recorded.constant:
        return -0.5 * changes @ _seen_by_subtasks(recorded, impedance, recorded.team.q0, v[0]).T
    states = zip(q, v, changes, strict=True)
    return np.array(
        [
            -0.5 * _seen_by_subtasks(recorded, impedance, q_k, v_k) @ change
            for q_k, v_k, change in states
        ]
    ).reshape(v.shape)


def _seen_by_subtasks(recorded: Recorded, impedance: Impedance, q: Array, v: Array) -> Array:
    """Return M_i J_i M^-1 of all subtasks at a state, shape (n, n)."""
    state, slices = recorded.team.state(q, v), recorded.stack.slices
    terms = task_dynamics(state, recorded.stack.evaluate(state), slices, impedance.inertias)
    seen = np.linalg.solve(terms.M, terms.J.T).T
    for part, inertia in zip(slices, terms.inertias, strict=True):
        seen[part] = inertia @ seen[part]
    return np.asarray(seen)


def deflection(impedance: Impedance, force: Array, duration: float) -> Array:
    """Return the largest deflection of each coordinate by a force (m, n), shape (n,) [m; rad].

    A spring deflects by F / K at rest; a damper alone moves by F T / D in a duration T [s].
    """
    largest = np.abs(force).max(axis=0, initial=0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        rest = np.nan_to_num(largest / impedance.stiffness, nan=0.0, posinf=np.inf)
    return OVERSHOOT * np.minimum(rest, largest * duration / impedance.damping)
