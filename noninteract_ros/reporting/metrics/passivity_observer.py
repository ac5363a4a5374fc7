# SPDX-License-Identifier: Apache-2.0
"""Independent passivity observer: energies from joint states and torques alone.

Over one tick, with the held torque tau_k, kinetic energy T and gravitational energy G,

    put in    = tau_k' (q_k+1 - q_k) - (G_k+1 - G_k)      by the controls, into the robots
    received  = (T_k+1 - T_k) - put in                    from all other forces on the robots

The observer uses only the model, recorded states and recorded torques: neither the law nor its
account nor force sensors. The account of the law sums the work on its errors e. External forces
also do work along the references, v_d = S dx_d/dt, so that

    received = received by the account + int v_d' tau_e dt,

with tau_e = M a + C v + g - tau_k from the recorded motion in the middle of each tick. The
integral includes the effect of the zero-order hold of J and g along moving references.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.errors import RecordingError
from noninteract_ros.reporting.checks.checks import Check, at_most, not_applicable
from noninteract_ros.reporting.metrics.intervals import continuous_steps
from noninteract_ros.reporting.metrics.team_account import TeamAccount, limits_acted, team_account
from noninteract_ros.reporting.recording.recorded import Recorded, common_times

CLAIM = "passivity.account"
# Allowed difference of the accounts relative to the energy turnover, at 1 kHz: references are
# known at the telemetry rate only, and may jump in between.
SAMPLED = 1e-3
ROUNDING = 1e-12  # [J]
BOOKED = "the account counts torques of joint limits and singularities as external work"
LATE = "wall time: the controller does not receive every state, and torques act late"


@dataclass(frozen=True)
class Observation:
    """Energies at the robots at each recorded state, shape (n,) each.

    Sums run over segments without gaps and continue from one segment to the next.

    Attributes:
        t: Time of the run [s].
        kinetic: Kinetic energy T [J].
        put_in: Energy put in by the controls since the start [J].
        received: Energy received from all other forces since the start; negative if given [J].
        along: Part of `received` along the references [J].
        segment: Number of the segment without gaps.
        commanded: Number of intervals whose torque is a recorded command.
        applied: Number of intervals whose torque is a measured effort.
        altered: Largest difference of a command from the measured effort [N or N m].
    """

    t: Array
    kinetic: Array
    put_in: Array
    received: Array
    along: Array
    segment: NDArray[np.intp]
    commanded: int
    applied: int
    altered: float

    @property
    def gaps(self) -> int:
        """Number of gaps: missing states or resets."""
        return int(self.segment[-1])

    @property
    def gap_time(self) -> float:
        """Total time of the gaps [s]."""
        return float(np.diff(self.t)[np.diff(self.segment) > 0].sum())


def observe(recorded: Recorded) -> Observation:
    """Compute the energies at the robots from joint states and commands."""
    valid = (np.diff(recorded.ticks) == 1) & continuous_steps(recorded)
    finite = np.isfinite(np.hstack((recorded.q, recorded.v, recorded.torque))).all(axis=1)
    valid &= finite[1:] & finite[:-1]
    rows = np.flatnonzero(valid)
    torque, commanded = _torques(recorded, rows)
    steps_q = recorded.steps[rows]
    kinetic, gravity = _energies(recorded, np.flatnonzero(finite))
    steps = np.zeros((3, len(recorded.t) - 1))
    steps[0, rows] = (torque * steps_q).sum(axis=1) - np.diff(gravity)[rows]
    steps[1, rows] = np.diff(kinetic)[rows] - steps[0, rows]
    steps[2, rows] = _work_along(recorded, rows, torque, steps_q)
    put_in, received, along = (np.concatenate(([0.0], np.cumsum(row))) for row in steps)
    segment = np.concatenate(([0], np.cumsum(~valid)))
    altered = float(np.abs(torque - recorded.torque[rows + 1]).max(initial=0.0))
    return Observation(
        t=recorded.t,
        kinetic=kinetic,
        put_in=put_in,
        received=received,
        along=along,
        segment=segment,
        commanded=int(commanded.sum()),
        applied=int((~commanded).sum()),
        altered=altered,
    )


def _torques(recorded: Recorded, rows: NDArray[np.intp]) -> tuple[Array, NDArray[np.bool_]]:
    """Return the torque held after states, shape (m, n), and True where it is a command.

    In lockstep it is the command with the stamp of the state. In wall time commands act late; the
    effort of the next state is the torque that acted.
    """
    torque, commanded = recorded.torque[rows + 1], np.zeros(len(rows), dtype=bool)
    if not recorded.lockstep or not recorded.has("joint_commands"):
        return torque, commanded
    commands = recorded.run.joints("joint_commands")
    columns = [commands.names.index(name) for name in recorded.team.joint_names]
    stamps, answered = (
        np.round(values * 1e9).astype(np.int64)
        for values in (commands.stamps, recorded.states.stamps[rows])
    )
    _, found, places = np.intersect1d(answered, stamps, return_indices=True)
    torque[found] = commands.effort[places][:, columns]
    commanded[found] = True
    return torque, commanded


def _energies(recorded: Recorded, rows: NDArray[np.intp]) -> tuple[Array, Array]:
    """Return kinetic and gravitational energy at all states, shape (n,); NaN except at `rows`."""
    team, still = recorded.team, np.zeros(recorded.team.n)
    kinetic, gravity = np.full((2, len(recorded.t)), np.nan)
    if recorded.constant:
        state = team.state(team.q0, still)
        q, v = recorded.q[rows], recorded.v[rows]
        kinetic[rows] = 0.5 * ((v @ state.M) * v).sum(axis=1)
        gravity[rows] = q @ state.g
        return kinetic, gravity
    for row in rows:
        gravity[row] = team.mechanical_energy(recorded.q[row], still)
        whole = team.mechanical_energy(recorded.q[row], recorded.v[row])
        kinetic[row] = whole - gravity[row]
    return kinetic, gravity


def _work_along(
    recorded: Recorded, rows: NDArray[np.intp], torque: Array, steps_q: Array
) -> Array:
    """Return the work of external forces along the references in each tick, shape (m,) [J].

    NaN if the references were not recorded.
    """
    work = np.zeros(len(rows))
    wanted = _desired_velocity(recorded, recorded.t[rows])
    if wanted is None:
        return np.full(len(rows), np.nan)
    team, rate = recorded.team, recorded.rate
    for number in np.flatnonzero(wanted.any(axis=1)):
        row = rows[number]
        q = team.integrate(recorded.q[row], 0.5 * steps_q[number])
        v = 0.5 * (recorded.v[row] + recorded.v[row + 1])
        acceleration = (recorded.v[row + 1] - recorded.v[row]) * rate
        external = team.inverse_dynamics(q, v, acceleration) - torque[number]
        state = team.state(q, v)
        task = recorded.stack.evaluate(state)
        try:
            along = np.linalg.solve(task.J, wanted[number])
            turned = np.linalg.solve(task.J, task.J_rate @ along)
        except np.linalg.LinAlgError:
            work[number] = np.nan
            continue
        # The law uses gravity and Jacobian of the start of the tick.
        drift = team.gravity(recorded.q[row]) - state.g
        held = 0.5 / rate * (torque[number] - state.g) @ turned
        work[number] = (along @ (external + drift) - held) / rate
    return work


def _desired_velocity(recorded: Recorded, t: Array) -> Array | None:
    """Return mean desired velocities over the ticks that begin at t, shape (len(t), n).

    Ticks with telemetry are extrapolated to the next tick, where references may jump; other ticks
    are interpolated. None if the desired motion was not recorded.
    """
    found, half = np.empty((len(t), recorded.team.n)), 0.5 / recorded.rate
    try:
        for name in recorded.stack.names:
            motion = recorded.motion(f"{name}/desired", name)
            if not len(motion.t):
                return None
            part = recorded.part(name)
            columns = [np.interp(t + half, motion.t, column) for column in motion.velocity.T]
            found[:, part] = np.array(columns).T
            rows, others = common_times(t, motion.t)
            found[rows, part] = motion.velocity[others] + half * motion.acceleration[others]
    except RecordingError:
        return None
    return found


def external_work(observed: Observation) -> tuple[Array, Array]:
    """Return times and the received work expected in the account, shape (m,) each [s, J]."""
    return observed.t, observed.received - observed.along


def passivity_metrics(recorded: Recorded) -> tuple[dict[str, Any], list[Check]]:
    """Return the observed energies and the check of the account of the law against them."""
    seen = observe(recorded)
    metrics: dict[str, Any] = {
        "gaps": seen.gaps,
        "gaps_s": seen.gap_time,
        "torques_commanded": seen.commanded,
        "torques_applied": seen.applied,
        "max_command_mismatch": seen.altered,
        "control_work_J": float(seen.put_in[-1]),
        "kinetic_J": float(seen.kinetic[-1]),
        "received_J": float(seen.received[-1]),
        "max_given_J": float(-seen.received.min()),
        "along_references_J": float(seen.along[-1]),
    }
    try:
        account = team_account(recorded)
    except RecordingError as error:
        reason = str(error)
        metrics["account"] = {"reason": reason}
        return metrics, [not_applicable(CLAIM, 0.0, "J", reason)]
    if np.isnan(seen.along).any():
        reason = "references or joint states are missing or not finite"
        metrics["account"] = {"reason": reason}
        return metrics, [not_applicable(CLAIM, 0.0, "J", reason)]
    difference, turnover = _disagreement(seen, account)
    telemetry_rate = min(recorded.rate, recorded.scenario.general.telemetry_rate)
    limit = SAMPLED * turnover * 1000.0 / telemetry_rate + ROUNDING
    metrics["account"] = {
        "disagreement_J": difference,
        "turnover_J": turnover,
        "allowed_J": limit,
    }
    reason = "" if recorded.lockstep else LATE
    if limits_acted(recorded, account):
        reason = BOOKED
    if reason:
        return metrics, [not_applicable(CLAIM, limit, "J", reason)]
    return metrics, [at_most(CLAIM, difference, limit, "J")]


def _disagreement(observed: Observation, account: TeamAccount) -> tuple[float, float]:
    """Return the largest difference of both accounts and the energy turnover [J].

    The accounts are compared within segments without gaps and without a reset of the account.
    """
    rows, others = common_times(observed.t, account.t)
    _, expected = external_work(observed)
    difference = account.received[others] - expected[rows]
    labels = np.stack((observed.segment[rows], account.account[others]), axis=1)
    starts = np.flatnonzero(np.diff(labels, axis=0, prepend=labels[:1] - 1).any(axis=1))
    largest = 0.0
    for segment in np.split(difference, starts[1:]):
        largest = max(largest, float(np.abs(segment - segment[0]).max()))
    passed = np.abs(np.diff(observed.put_in)) + np.abs(np.diff(observed.kinetic))
    return largest, float(np.nansum(passed))
