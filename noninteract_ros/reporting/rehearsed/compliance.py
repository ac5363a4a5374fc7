# SPDX-License-Identifier: Apache-2.0
"""Comparison of tracking errors under all laws and under compliance control.

Plain compliance control is a baseline, not a law of this package. The impedance of each subtask is
mapped to the joints by J' and gravity is compensated; the dynamics are otherwise unknown,

    tau = J' (-D e_rate - h(e)) + g

Compliance control and the law `natural` act on the inertia Lambda of all subtasks, the
noninteracting law on M_i. Damping designed for M_i can be too large for a light wrist in Lambda:
the sampled loop is unstable once an eigenvalue of Lambda^-1 D times the tick exceeds two. For a
fair comparison with any gains, both baselines use damping of their own, critical in every mode of
K and Lambda (double diagonalization),

    K V = Lambda V diag(w^2),    V' Lambda V = 1,    D = Lambda V diag(2 w) V' Lambda
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigh

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.decoupling import LAWS, task_dynamics
from noninteract_ros.control.tick import Tick
from noninteract_ros.reporting.rehearsed.processes import in_processes
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.rehearsal import Rehearsal

COMPLIANCE = "compliance, own damping"
NATURAL = "natural, own damping"
STABLE = 2.0  # largest damping per tick of a stable sampled loop
RATES = (0.5, 1.0, 2.0)  # rates of the comparison relative to the scenario's


@dataclass(frozen=True)
class PeakErrors:
    """Largest errors of one run.

    Attributes:
        law: Law or baseline.
        rate: Control rate [Hz].
        position: Largest error of a coordinate of each subtask that has positions [m].
        angle: Largest error of each subtask that has rotations or angles [rad].
        speed: Largest speed of an element of the desired motions [m/s].
        turning: Largest angular speed of the desired motions [rad/s].
        damping_per_tick: Largest eigenvalue of inertia^-1 D at the start, times the tick; sampled
            loops are stable below about 2.
        intervened: True if a joint limit or a singularity changed the torque.
    """

    law: str
    rate: float
    position: dict[str, float]
    angle: dict[str, float]
    speed: float
    turning: float
    damping_per_tick: float
    intervened: bool


class ComplianceRehearsal(Rehearsal):
    """Rehearsal with the torque of plain compliance control."""

    def command(self, tick: Tick) -> Array:
        """Return J' (-D e_rate - h(e)) + g at a tick, shape (n,) [N or N m]."""
        impedance, error = self.controller.mode.impedance, tick.error
        damping = critical_damping(task_inertia(tick), impedance.stiffness)
        force = -damping @ error.e_rate - impedance.force(error.e)
        return tick.task.J.T @ force + tick.state.g


class NaturalRehearsal(Rehearsal):
    """Rehearsal under the law `natural`, with critical damping for its inertia."""

    def command(self, tick: Tick) -> Array:
        """Return the torque of the law with critical D, shape (n,) [N or N m]."""
        impedance, error = self.controller.mode.impedance, tick.error
        damping = critical_damping(task_inertia(tick), impedance.stiffness)
        more = impedance.damping * error.e_rate - damping @ error.e_rate
        return tick.torque + tick.task.J.T @ more


# Law of the controller and rehearsal of each baseline.
BASELINES: dict[str, tuple[str, type[Rehearsal]]] = {
    COMPLIANCE: ("noninteracting", ComplianceRehearsal),
    NATURAL: ("natural", NaturalRehearsal),
}


def task_inertia(tick: Tick) -> Array:
    """Return Lambda = S' M S, shape (n, n)."""
    S = np.linalg.inv(tick.task.J)
    return S.T @ tick.state.M @ S


def critical_damping(inertia: Array, stiffness: Array) -> Array:
    """Return critical D for inertia (n, n) and stiffness K (n,), shape (n, n); 0 where K is 0."""
    squares, modes = eigh(np.diag(stiffness), inertia)
    shaped = inertia @ modes
    return np.asarray(shaped * (2.0 * np.sqrt(np.maximum(squares, 0.0))) @ shaped.T)


def measure_law(scenario: Scenario, law: str, rate: float, duration: float) -> PeakErrors:
    """Rehearse a scenario under a law or a baseline.

    Args:
        scenario: The scenario.
        law: One of the laws, `NATURAL` or `COMPLIANCE`.
        rate: Control rate and update rate of the device [Hz].
        duration: Duration [s].
    """
    law_of_controller, kind = BASELINES.get(law, (law, Rehearsal))
    general = replace(scenario.general, rate=rate, law=law_of_controller)
    haptic = scenario.haptic and replace(scenario.haptic, update_rate=rate)
    rehearsal = kind(replace(scenario, general=general, haptic=haptic))
    first = rehearsal.step()
    ticks = [_row(rehearsal, first)]
    ticks += [_row(rehearsal, rehearsal.step()) for _ in range(1, round(duration * rate))]
    e, speeds, acted = (np.array(column) for column in zip(*ticks, strict=True))
    position, angle = {}, {}
    for task, part in zip(rehearsal.stack.subtasks, rehearsal.stack.slices, strict=True):
        sizes, lengths = task.magnitudes(e[:, part]), np.array(task.units) == "m"
        if lengths.any():
            position[task.name] = float(np.abs(e[:, part][:, lengths]).max())
        if "rad" in sizes:
            angle[task.name] = float(sizes["rad"].max())
    speed, turning = (float(largest) for largest in speeds.max(axis=0))
    damping = _damping_per_tick(rehearsal, first, law) / rate
    intervened = bool(acted.any()) and law != COMPLIANCE
    return PeakErrors(law, rate, position, angle, speed, turning, damping, intervened)


def _row(rehearsal: Rehearsal, tick: Tick) -> tuple[Array, tuple[float, float], bool]:
    """Return errors, largest desired speeds, and True if the law did not act alone."""
    speed, turning, none = 0.0, 0.0, np.zeros(1)
    for task, led in zip(rehearsal.stack.subtasks, tick.led, strict=True):
        sizes = task.magnitudes(led.reference.velocity)
        speed = max(speed, float(sizes.get("m", none).max()))
        turning = max(turning, float(sizes.get("rad", none).max()))
    return tick.error.e, (speed, turning), tick.intervened


def _damping_per_tick(rehearsal: Rehearsal, tick: Tick, law: str) -> float:
    """Return the largest eigenvalue of inertia^-1 D [1/s] for the task inertia under a law."""
    impedance, inertia = rehearsal.controller.mode.impedance, task_inertia(tick)
    damping = np.diag(impedance.damping)
    if law in BASELINES:
        damping = critical_damping(inertia, impedance.stiffness)
    elif law != "natural":
        slices = rehearsal.stack.slices
        terms = task_dynamics(tick.state, tick.task, slices, impedance.inertias)
        inertia = np.zeros_like(inertia)
        for part, own in zip(slices, terms.inertias, strict=True):
            inertia[part, part] = own
    return float(np.abs(np.linalg.eigvals(np.linalg.solve(inertia, damping))).max())


def compare_laws(scenario: Scenario, duration: float) -> list[PeakErrors]:
    """Rehearse the same motion under each law and baseline, and under its own law at other rates.

    Args:
        scenario: The scenario.
        duration: Duration [s].
    """
    rate = scenario.general.rate
    jobs = [(scenario, scenario.general.law, rate * share, duration) for share in RATES]
    others = [law for law in LAWS if law not in (scenario.general.law, "paper")]
    jobs += [(scenario, law, rate, duration) for law in (*others, *BASELINES)]
    order = sorted(range(len(jobs)), key=lambda number: -jobs[number][2])  # Longest first.
    found = in_processes(measure_law, [jobs[number] for number in order])
    return [errors for _, errors in sorted(zip(order, found, strict=True), key=lambda x: x[0])]


def convergence_order(rows: Sequence[PeakErrors], subtask: str) -> float | None:
    """Return the order of convergence of a subtask's error in the tick under one law.

    Estimated from the lowest stable rate and the highest rate; None without two stable rates or
    without error.
    """
    rows = [row for row in rows if row.law == rows[0].law and row.damping_per_tick < STABLE]
    if len(rows) < 2:
        return None
    first, last = (
        max(row.position.get(subtask, 0.0), row.angle.get(subtask, 0.0))
        for row in (rows[0], rows[-1])
    )
    if not (first > 0.0 and last > 0.0):
        return None
    return math.log(first / last) / math.log(rows[-1].rate / rows[0].rate)


def laws_metrics(rows: Sequence[PeakErrors], duration: float) -> dict[str, object]:
    """Return the rows as section of `metrics.json`."""
    names = dict.fromkeys([*rows[0].position, *rows[0].angle])
    return {
        "duration_s": duration,
        "speed_m_per_s": rows[0].speed,
        "turning_rad_per_s": rows[0].turning,
        "convergence_order": {name: convergence_order(rows, name) for name in names},
        "rows": [
            {
                "law": row.law,
                "rate_Hz": row.rate,
                "max_error_m": row.position,
                "max_error_rad": row.angle,
                "damping_per_tick": row.damping_per_tick,
                "limits_acted": row.intervened,
            }
            for row in rows
        ],
    }
