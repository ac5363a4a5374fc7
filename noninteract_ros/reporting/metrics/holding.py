# SPDX-License-Identifier: Apache-2.0
"""What holding the torque over a tick does to the subtasks.

The law finds tau_k at tick k and the team holds it until tick k + 1, where the law asks for
tau_k+1. In between the law would have led from the one to the other, so that on the average half
of the change is missing. Seen by the subtasks this is one more external force in (29), of first
order in the tick:

    tau~_i = -1/2 M_i J_i M^-1 (tau_k+1 - tau_k)

It is computed from the recorded torques, and so are all bounds that follow from it; they fall with
the rate as it does. It is no margin: a law that lets motions cross over, or that makes energy, is
not excused by it. On the scenario planar_arms it explains the balance (33) of either subtask to
2 %, where it is all that there is.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.decoupling import task_dynamics
from noninteract_ros.control.law.impedance import Impedance, stack_impedance
from noninteract_ros.reporting.recording.recorded import Recorded

OVERSHOOT = (
    2.0  # a force that sets in at once swings a damped loop at most twice as far as it rests
)


@dataclass(frozen=True)
class Holding:
    """The force that stands for holding the torque, at some states of a run.

    Attributes:
        t: Time of the run, shape (m,) [s].
        force: On all subtasks' coordinates, shape (m, n) [N; N m].
    """

    t: Array
    force: Array


def impedance_of(recorded: Recorded) -> Impedance:
    """Gains of a run's scenario."""
    settings = [spec.impedance for spec in recorded.scenario.subtasks.values()]
    return stack_impedance(recorded.stack.subtasks, settings)


def told_rows(recorded: Recorded, count: int | None = None) -> NDArray[np.intp]:
    """States, of the first so many, at which the telemetry speaks."""
    general = recorded.scenario.general
    period = max(1, round(general.rate / general.telemetry_rate))
    return np.flatnonzero(recorded.ticks[:count] % period == 0)


def recorded_holding(recorded: Recorded) -> Holding:
    """The force in a recorded run in lockstep.

    A state's effort is what was held until then, that of the next one what the law asked for at
    the state. At the first and the last state nothing is known.
    """
    changes = np.zeros_like(recorded.v)
    changes[1:-1] = np.diff(recorded.torque[1:], axis=0)
    rows = told_rows(recorded)
    force = holding_force(recorded, recorded.q[rows], recorded.v[rows], changes[rows])
    return Holding(recorded.t[rows], force)


def holding_force(recorded: Recorded, q: Array, v: Array, changes: Array) -> Array:
    """The force at states q (m, nq), v (m, n) for changes of the torque (m, n), shape (m, n)."""
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
    """M_i J_i M^-1 of all subtasks at a state, shape (n, n): what a torque is to them."""
    state, slices = recorded.team.state(q, v), recorded.stack.slices
    terms = task_dynamics(state, recorded.stack.evaluate(state), slices, impedance.inertias)
    seen = np.linalg.solve(terms.M, terms.J.T).T
    for part, inertia in zip(slices, terms.inertias, strict=True):
        seen[part] = inertia @ seen[part]
    return np.asarray(seen)


def deflection(impedance: Impedance, force: Array, duration: float) -> Array:
    """How far a force (m, n) can have moved each coordinate, shape (n,) [m; rad].

    A spring gives way by F / K; a damper alone, over the duration [s], by F T / D.
    """
    largest = np.abs(force).max(axis=0, initial=0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        rest = np.nan_to_num(largest / impedance.stiffness, nan=0.0, posinf=np.inf)
    return OVERSHOOT * np.minimum(rest, largest * duration / impedance.damping)
