# SPDX-License-Identifier: Apache-2.0
"""Order of convergence of the storage balances (33) with the control rate.

In continuous time the storage function S_i grows by the integral of its rate. The zero-order hold
of the torque is an additional force F_i on the subtask, of first order in the tick
(`zero_order_hold`):

    S_i(t) - S_i(0) - int rate_i dt            is of first order in the tick,
    ... - int e_rate_i' F_i dt                 is of second order;
    F_i = -1/2 M_i J_i M^-1 (tau_k+1 - tau_k)

Errors due to sampling alone are of first order in the tick, and their energy of second order. To
excite the balances, all subtasks start with the velocity `INITIAL_SPEED`.

The remaining residual is due to the trapezoidal rule and to the mean force over a tick. The plant
is integrated to fourth order, which is negligible here.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.control.tick import Tick
from noninteract_ros.reporting.checks.checks import Check, at_least, not_applicable
from noninteract_ros.reporting.metrics.intervals import reference_jumps, segments
from noninteract_ros.reporting.metrics.storage_functions import integral
from noninteract_ros.reporting.recording.recorded import FRICTION, RecordedMotion
from noninteract_ros.reporting.rehearsed.processes import in_processes
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.rehearsal import Rehearsal

RATES = (1.0, 2.0, 4.0)  # relative to the scenario's
MAX_DURATION = 0.5  # [s] of each rehearsal
ORDERS = (0.85, 1.7)  # smallest orders that pass, without and with the hold work
CHECKS = ("storage_order", "storage_order_explained")
INITIAL_SPEED = 0.1  # [m/s; rad/s] velocity of every coordinate of the subtasks at the start


@dataclass(frozen=True)
class Residuals:
    """Residuals of the storage balances at one rate, by subtask.

    Attributes:
        rate: Control rate [Hz].
        peak: Largest storage [J].
        missed: Largest difference of the storage from its integrated rate [J].
        unexplained: The same after adding the hold work [J].
    """

    rate: float
    peak: dict[str, float]
    missed: dict[str, float]
    unexplained: dict[str, float]


def unknown_supply(scenario: Scenario) -> str:
    """Return the reason why the supplied energy is unknown, or an empty text."""
    team = scenario.build_team()
    if team.friction.any():
        return FRICTION
    if any(not push.on_tool(team) for push in scenario.pushes.values()):
        return "a push acts on a link, not on a tool"
    if scenario.held is not None:
        return "the force of the object jumps with the torque within a tick"
    return ""


def storage_orders(scenario: Scenario, duration: float) -> tuple[dict[str, Any], list[Check]]:
    """Return metrics and checks of the residuals at one, two and four times the rate.

    Args:
        scenario: The scenario.
        duration: Largest duration [s].
    """
    names = list(scenario.subtasks)
    if reason := unknown_supply(scenario):
        return {"reason": reason}, [
            not_applicable(f"{check}.{name}", limit, "", reason)
            for name in names
            for check, limit in zip(CHECKS, ORDERS, strict=True)
        ]
    rate = scenario.general.rate
    jobs = [(scenario, rate * share, min(MAX_DURATION, duration)) for share in reversed(RATES)]
    rows = list(reversed(in_processes(storage_residuals, jobs)))
    metrics, checks = {}, []
    for name in names:
        orders = convergence_order(rows, name), convergence_order(rows, name, explained=True)
        metrics[name] = {
            "rate_Hz": [row.rate for row in rows],
            "peak_J": [row.peak[name] for row in rows],
            "missed_J": [row.missed[name] for row in rows],
            "unexplained_J": [row.unexplained[name] for row in rows],
            "order": orders[0],
            "order_unexplained": orders[1],
        }
        for check, found, limit in zip(CHECKS, orders, ORDERS, strict=True):
            checks.append(
                not_applicable(f"{check}.{name}", limit, "", "no residual")
                if found is None
                else at_least(f"{check}.{name}", found, limit, "")
            )
    return metrics, checks


def storage_residuals(scenario: Scenario, rate: float, duration: float) -> Residuals:
    """Rehearse a scenario at a rate [Hz] for a duration [s] and balance its storage functions."""
    general = replace(scenario.general, rate=rate)
    haptic = scenario.haptic and replace(scenario.haptic, update_rate=rate)
    rehearsal = Rehearsal(replace(scenario, general=general, haptic=haptic))
    team, simulation = rehearsal.team, rehearsal.simulation
    J = rehearsal.stack.evaluate(team.state(simulation.q, simulation.v)).J
    simulation.v = np.linalg.solve(J, np.full(team.n, INITIAL_SPEED))
    rows = list(_rows(rehearsal, round(duration * rate)))
    ticks = [tick for tick, *_ in rows]
    t, storage, power = (np.array([row[column] for row in rows]) for column in (1, 2, 3))
    hold = _hold_powers(ticks, rehearsal.stack.slices)
    found: tuple[dict[str, float], ...] = ({}, {}, {})
    in_law = ~np.array([tick.intervened for tick in ticks])
    for i, task in enumerate(rehearsal.stack.subtasks):
        led = [tick.led[i].reference for tick in ticks]
        columns = zip(*((x.position, x.velocity, x.acceleration) for x in led), strict=True)
        valid = ~reference_jumps(
            task.layout, RecordedMotion(t, *(np.array(column) for column in columns))
        )
        valid &= in_law[1:] & in_law[:-1]
        found[0][task.name] = float(storage[:, i].max())
        for place, supplied in ((1, power[:, i]), (2, power[:, i] + hold[:, i])):
            found[place][task.name] = _largest(t, storage[:, i], supplied, valid)
    return Residuals(rate, *found)


def _rows(rehearsal: Rehearsal, count: int) -> Iterator[tuple[Tick, float, Array, Array]]:
    """Yield tick, time, storage functions and their rates."""
    for _ in range(count):
        now, wrenches = rehearsal.simulation.now, rehearsal.simulation.external_wrenches()
        tick = rehearsal.step()
        energy = rehearsal.energy(tick, wrenches)
        yield tick, now, energy.storage, energy.rate


def _hold_powers(ticks: Sequence[Tick], slices: Sequence[slice]) -> Array:
    """Return the power of the hold force on each subtask, shape (ticks, subtasks) [W]."""
    powers = np.zeros((len(ticks), len(slices)))
    for row, (tick, following) in enumerate(pairwise(ticks)):
        change = following.torque - tick.torque
        force = -0.5 * tick.dynamics.decoupled_external_force(change)
        parts = (tick.error.e_rate[part] @ force[part] for part in slices)
        powers[row] = np.fromiter(parts, float)
    return powers


def _largest(t: Array, storage: Array, power: Array, valid: NDArray[np.bool_]) -> float:
    """Return the largest difference of storage and integrated power over any segment [J]."""
    missed = storage - integral(t, power)
    largest = 0.0
    for first, last in segments(valid):
        segment = missed[first : last + 1]
        largest = max(largest, float(np.ptp(segment)))
    return largest


def convergence_order(
    rows: Sequence[Residuals], subtask: str, explained: bool = False
) -> float | None:
    """Return the order of convergence of a residual in the tick, from first to last rate.

    None if a residual is zero.
    """
    first, last = (
        (row.unexplained if explained else row.missed)[subtask] for row in (rows[0], rows[-1])
    )
    if not (first > 0.0 and last > 0.0):
        return None
    return math.log(first / last) / math.log(rows[-1].rate / rows[0].rate)
