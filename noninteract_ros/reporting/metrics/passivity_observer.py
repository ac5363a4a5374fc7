# SPDX-License-Identifier: Apache-2.0
"""A passivity observer that trusts nobody: energies from joint states and torques alone.

From a state to the next, with the torque that was held between them and the energy G in gravity,

    put in    = tau_k' (q_k+1 - q_k) - (G_k+1 - G_k)      by the controls, into the robots
    received  = (T_k+1 - T_k) - put in                    from whatever else acts on the robots

Neither the law nor its account nor a force sensor takes part: kinetic energy, gravity and torques
are the model's and the recording's. What the law says that it received is another sum, of work on
its errors e. Forces from outside also work along the references, v_d = S dx_d/dt, and

    received = received by the law + int v_d' tau_e dt,

with tau_e from the recorded motion as well: M a + C v + g - tau_k in the middle of each tick. To
the integral belongs what holding J and g over a tick does along references that move.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.errors import RecordingError
from noninteract_ros.reporting.checks.checks import Check, at_most, not_applicable
from noninteract_ros.reporting.metrics.intervals import moved_by_itself
from noninteract_ros.reporting.metrics.team_account import TeamAccount, limits_acted, team_account
from noninteract_ros.reporting.recording.recorded import Recorded, common_instants

CLAIM = "passivity.account"
# Share of the energy that passed by which the accounts may differ, at 1 kHz: of the references
# only what telemetry tells of them is known, and they jump in between.
SAMPLED = 1e-3
ROUNDING = 1e-12  # [J]
BOOKED = "the account books torques of joint limits and singularities as pushes from outside"
LATE = "wall time: the controller does not see each state, nor when its torques act"


@dataclass(frozen=True)
class Observation:
    """Energies at the robots at each recorded state, shape (n,) each.

    Sums go over pieces of the run without a gap; at the first state of each they are as at the
    last state before.

    Attributes:
        t: Time of the run [s].
        kinetic: T [J].
        put_in: Energy that the controls put in since the start [J].
        received: Energy from anything else since the start; negative, where the robots gave [J].
        along: Its part along the references [J].
        piece: Number of the piece without a gap.
        commanded: How many intervals had a torque that was commanded for their first state.
        applied: How many had a torque that only the robots told of.
        altered: Largest difference of a command from what the robots told of [N or N m].
    """

    t: Array
    kinetic: Array
    put_in: Array
    received: Array
    along: Array
    piece: NDArray[np.intp]
    commanded: int
    applied: int
    altered: float

    @property
    def gaps(self) -> int:
        """How many times states are missing, or the team was put elsewhere."""
        return int(self.piece[-1])

    @property
    def unseen(self) -> float:
        """Time in gaps [s]."""
        return float(np.diff(self.t)[np.diff(self.piece) > 0].sum())


def observe(recorded: Recorded) -> Observation:
    """Energies at the robots from what joint states and commands say."""
    seen = (np.diff(recorded.ticks) == 1) & moved_by_itself(recorded)
    finite = np.isfinite(np.hstack((recorded.q, recorded.v, recorded.torque))).all(axis=1)
    seen &= finite[1:] & finite[:-1]
    rows = np.flatnonzero(seen)
    torque, commanded = _torques(recorded, rows)
    way = recorded.steps[rows]
    kinetic, gravity = _energies(recorded, np.flatnonzero(finite))
    steps = np.zeros((3, len(recorded.t) - 1))
    steps[0, rows] = (torque * way).sum(axis=1) - np.diff(gravity)[rows]
    steps[1, rows] = np.diff(kinetic)[rows] - steps[0, rows]
    steps[2, rows] = _work_along(recorded, rows, torque, way)
    put_in, received, along = (np.concatenate(([0.0], np.cumsum(row))) for row in steps)
    piece = np.concatenate(([0], np.cumsum(~seen)))
    altered = float(np.abs(torque - recorded.torque[rows + 1]).max(initial=0.0))
    counts = int(commanded.sum()), int((~commanded).sum())
    return Observation(recorded.t, kinetic, put_in, received, along, piece, *counts, altered)


def _torques(recorded: Recorded, rows: NDArray[np.intp]) -> tuple[Array, NDArray[np.bool_]]:
    """Torque held after each of some states, shape (m, n), and whether it is a command's.

    In lockstep that is the command with the stamp of the state. In wall time commands act late,
    and only the effort of the next state says which one did.
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
    """Kinetic energy and energy in gravity at all states, shape (n,) each; NaN but at some."""
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


def _work_along(recorded: Recorded, rows: NDArray[np.intp], torque: Array, way: Array) -> Array:
    """Work of all that acts from outside along the references, over some ticks, shape (m,) [J].

    NaN where nobody recorded the references.
    """
    work = np.zeros(len(rows))
    wanted = _desired_velocity(recorded, recorded.t[rows])
    if wanted is None:
        return np.full(len(rows), np.nan)
    team, rate = recorded.team, recorded.rate
    for number in np.flatnonzero(wanted.any(axis=1)):
        row = rows[number]
        q = team.integrate(recorded.q[row], 0.5 * way[number])
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
        # Over the tick the law counts with gravity and Jacobian as they were when it began.
        drift = team.gravity(recorded.q[row]) - state.g
        held = 0.5 / rate * (torque[number] - state.g) @ turned
        work[number] = (along @ (external + drift) - held) / rate
    return work


def _desired_velocity(recorded: Recorded, t: Array) -> Array | None:
    """Mean desired velocities of all subtasks in the ticks that begin at t, shape (len(t), n).

    Where telemetry tells of a tick its motion goes on to the next one, at which it may jump. In
    between nobody knows more than the ends. None if it was not recorded.
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
            rows, told = common_instants(t, motion.t)
            found[rows, part] = motion.velocity[told] + half * motion.acceleration[told]
    except RecordingError:
        return None
    return found


def surroundings_work(seen: Observation) -> tuple[Array, Array]:
    """Times and what the law's account should say that it received, shape (m,) each [s, J]."""
    return seen.t, seen.received - seen.along


def passivity_metrics(recorded: Recorded) -> tuple[dict[str, Any], list[Check]]:
    """What was observed, and whether the law's own account says the same."""
    seen = observe(recorded)
    metrics: dict[str, Any] = {
        "gaps": seen.gaps,
        "not_seen_s": seen.unseen,
        "torques_commanded": seen.commanded,
        "torques_applied": seen.applied,
        "torques_altered_by": seen.altered,
        "put_in_by_controls_J": float(seen.put_in[-1]),
        "kinetic_J": float(seen.kinetic[-1]),
        "received_J": float(seen.received[-1]),
        "given_at_most_J": float(-seen.received.min()),
        "along_references_J": float(seen.along[-1]),
    }
    try:
        told = team_account(recorded)
    except RecordingError as error:
        reason = str(error)
        metrics["account"] = {"reason": reason}
        return metrics, [not_applicable(CLAIM, 0.0, "J", reason)]
    if np.isnan(seen.along).any():
        reason = "references or joint states are missing or no numbers"
        metrics["account"] = {"reason": reason}
        return metrics, [not_applicable(CLAIM, 0.0, "J", reason)]
    apart, turnover = _disagreement(seen, told)
    told_at = min(recorded.rate, recorded.scenario.general.telemetry_rate)
    limit = SAMPLED * turnover * 1000.0 / told_at + ROUNDING
    metrics["account"] = {
        "disagreement_J": apart,
        "turnover_J": turnover,
        "allowed_J": limit,
    }
    reason = "" if recorded.lockstep else LATE
    if limits_acted(recorded, told):
        reason = BOOKED
    if reason:
        return metrics, [not_applicable(CLAIM, limit, "J", reason)]
    return metrics, [at_most(CLAIM, apart, limit, "J")]


def _disagreement(seen: Observation, told: TeamAccount) -> tuple[float, float]:
    """Largest difference of both accounts, and how much energy passed in the steps seen [J].

    Both are compared within pieces without a gap in the recording and without a new account.
    """
    rows, others = common_instants(seen.t, told.t)
    _, expected = surroundings_work(seen)
    difference = told.received[others] - expected[rows]
    pieces = np.stack((seen.piece[rows], told.account[others]), axis=1)
    starts = np.flatnonzero(np.diff(pieces, axis=0, prepend=pieces[:1] - 1).any(axis=1))
    apart = 0.0
    for piece in np.split(difference, starts[1:]):
        apart = max(apart, float(np.abs(piece - piece[0]).max()))
    passed = np.abs(np.diff(seen.put_in)) + np.abs(np.diff(seen.kinetic))
    return apart, float(np.nansum(passed))
