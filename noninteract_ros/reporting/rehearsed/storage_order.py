# SPDX-License-Identifier: Apache-2.0
"""Each storage function against the energy supplied to it (33), at several rates.

In continuous time the storage function S_i grows by the integral of its rate. The torque is held
over each tick, which is one more force F_i on the subtask, of first order in it (`holding`):

    S_i(t) - S_i(0) - int rate_i dt            falls with the tick,
    ... - int e_rate_i' F_i dt                 with its square;
    F_i = -1/2 M_i J_i M^-1 (tau_k+1 - tau_k)

Errors that come from sampling alone fall with the tick themselves, and their energy with its
square. So that there is something to balance, the team starts off its references: all subtasks
move, at `STRUCK`, as if somebody had struck the team.

What is left over is that of the trapezoidal rule and of a force that stands for its mean.
The plant itself is integrated to fourth order, which does not show beside these.
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
from noninteract_ros.reporting.metrics.intervals import jumps, pieces
from noninteract_ros.reporting.metrics.storage_functions import integral
from noninteract_ros.reporting.recording.recorded import FRICTION, RecordedMotion
from noninteract_ros.reporting.rehearsed.processes import in_processes
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.rehearsal import Rehearsal

RATES = (1.0, 2.0, 4.0)  # of the scenario's
LONGEST = 0.5  # [s] of each rehearsal
ORDERS = (0.85, 1.7)  # lowest that pass, before and after the work of holding is counted
CLAIMS = ("storage_order", "storage_order_explained")
STRUCK = 0.1  # [m/s; rad/s] velocity of every coordinate of the subtasks at the start


@dataclass(frozen=True)
class Residuals:
    """What the balance of each subtask misses at one rate; by subtask.

    Attributes:
        rate: Ticks per second [Hz].
        peak: Largest storage [J].
        missed: Largest difference of storage from the integral of its rate, over any time [J].
        unexplained: What is left of it when the work of holding the torque is counted [J].
    """

    rate: float
    peak: dict[str, float]
    missed: dict[str, float]
    unexplained: dict[str, float]


def unknown_supply(scenario: Scenario) -> str:
    """Why the energy supplied to a subtask is not known, or an empty text."""
    team = scenario.build_team()
    if team.friction.any():
        return FRICTION
    if any(not push.on_tool(team) for push in scenario.pushes.values()):
        return "people push elsewhere than at the tools"
    if scenario.held is not None:
        return "what the object exerts jumps with the torque, inside the tick"
    return ""


def storage_orders(scenario: Scenario, duration: float) -> tuple[dict[str, Any], list[Check]]:
    """Residuals of a scenario at once, twice and four times its rate, as metrics and checks.

    Args:
        scenario: What to run.
        duration: How long at most [s].
    """
    names = list(scenario.subtasks)
    if reason := unknown_supply(scenario):
        return {"reason": reason}, [
            not_applicable(f"{claim}.{name}", limit, "", reason)
            for name in names
            for claim, limit in zip(CLAIMS, ORDERS, strict=True)
        ]
    rate = scenario.general.rate
    jobs = [(scenario, rate * share, min(LONGEST, duration)) for share in reversed(RATES)]
    rows = list(reversed(in_processes(storage_residuals, jobs)))
    metrics, checks = {}, []
    for name in names:
        orders = order(rows, name), order(rows, name, explained=True)
        metrics[name] = {
            "rate_Hz": [row.rate for row in rows],
            "peak_J": [row.peak[name] for row in rows],
            "missed_J": [row.missed[name] for row in rows],
            "unexplained_J": [row.unexplained[name] for row in rows],
            "order": orders[0],
            "order_unexplained": orders[1],
        }
        for claim, found, limit in zip(CLAIMS, orders, ORDERS, strict=True):
            checks.append(
                not_applicable(f"{claim}.{name}", limit, "", "no residual")
                if found is None
                else at_least(f"{claim}.{name}", found, limit, "")
            )
    return metrics, checks


def storage_residuals(scenario: Scenario, rate: float, duration: float) -> Residuals:
    """Rehearses a scenario at a rate [Hz] for a time [s] and balances every storage function."""
    general = replace(scenario.general, rate=rate)
    haptic = scenario.haptic and replace(scenario.haptic, update_rate=rate)
    rehearsal = Rehearsal(replace(scenario, general=general, haptic=haptic))
    team, simulation = rehearsal.team, rehearsal.simulation
    J = rehearsal.stack.evaluate(team.state(simulation.q, simulation.v)).J
    simulation.v = np.linalg.solve(J, np.full(team.n, STRUCK))
    rows = list(_rows(rehearsal, round(duration * rate)))
    ticks = [tick for tick, *_ in rows]
    t, storage, power = (np.array([row[column] for row in rows]) for column in (1, 2, 3))
    holding = _holding_powers(ticks, rehearsal.stack.slices)
    found: tuple[dict[str, float], ...] = ({}, {}, {})
    in_law = ~np.array([tick.intervened for tick in ticks])
    for i, task in enumerate(rehearsal.stack.subtasks):
        led = [tick.led[i].reference for tick in ticks]
        columns = zip(*((x.position, x.velocity, x.acceleration) for x in led), strict=True)
        told = ~jumps(task.layout, RecordedMotion(t, *(np.array(column) for column in columns)))
        told &= in_law[1:] & in_law[:-1]
        found[0][task.name] = float(storage[:, i].max())
        for place, supplied in ((1, power[:, i]), (2, power[:, i] + holding[:, i])):
            found[place][task.name] = _largest(t, storage[:, i], supplied, told)
    return Residuals(rate, *found)


def _rows(rehearsal: Rehearsal, count: int) -> Iterator[tuple[Tick, float, Array, Array]]:
    """Tick, time, storage functions and their rates."""
    for _ in range(count):
        now, wrenches = rehearsal.simulation.now, rehearsal.simulation.external_wrenches()
        tick = rehearsal.step()
        energy = rehearsal.energy(tick, wrenches)
        yield tick, now, energy.storage, energy.rate


def _holding_powers(ticks: Sequence[Tick], slices: Sequence[slice]) -> Array:
    """Power of holding the torque on each subtask, shape (ticks, subtasks) [W]."""
    powers = np.zeros((len(ticks), len(slices)))
    for row, (tick, following) in enumerate(pairwise(ticks)):
        change = following.torque - tick.torque
        force = -0.5 * tick.dynamics.decoupled_external_force(change)
        parts = (tick.error.e_rate[part] @ force[part] for part in slices)
        powers[row] = np.fromiter(parts, float)
    return powers


def _largest(t: Array, storage: Array, power: Array, told: NDArray[np.bool_]) -> float:
    """Largest difference over the time from the first state of each piece [J]."""
    missed = storage - integral(t, power)
    largest = 0.0
    for first, last in pieces(told):
        piece = missed[first : last + 1]
        largest = max(largest, float(np.ptp(piece)))
    return largest


def order(rows: Sequence[Residuals], subtask: str, explained: bool = False) -> float | None:
    """Power of the tick with which a residual falls from the first rate to the last.

    None where there is nothing that could fall.
    """
    first, last = (
        (row.unexplained if explained else row.missed)[subtask] for row in (rows[0], rows[-1])
    )
    if not (first > 0.0 and last > 0.0):
        return None
    return math.log(first / last) / math.log(rows[-1].rate / rows[0].rate)
