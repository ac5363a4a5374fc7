# SPDX-License-Identifier: Apache-2.0
"""The account in the loop of a case: what is booked from state to state, and its residual."""

from typing import Any

from noninteract_ros.arrays import Array
from noninteract_ros.validation.gauntlet.account import compiled_account
from noninteract_ros.validation.gauntlet.arrays import TeamArrays, compiled, copy
from noninteract_ros.validation.gauntlet.law import (
    KINETIC,
    LIFTED,
    Terms,
    complete_force,
    impedance_force,
    potential,
    power,
    storage,
)
from noninteract_ros.validation.gauntlet.state import GATED, NATURAL, PAPER, Memory, Meter

ACCOUNT = compiled_account()
account_step, full_tank, observed = ACCOUNT.step, ACCOUNT.full_tank, ACCOUNT.observed
Interval = ACCOUNT.interval


@compiled
def gates_of(law: int, tank: Any) -> Any:
    """The account with the gates that a law has."""
    if law == GATED:
        return tank
    return observed(tank, 0.0 if law == NATURAL else 1.0)


@compiled
def book(
    team: TeamArrays,
    terms: Terms,
    law: int,
    memory: Memory,
    applied: Array,
    now: float,
    tank: Any,
    settings: Any,
    meter: Meter,
) -> Any:
    """The account after the interval since the last state that arrived."""
    elapsed, natural, beyond, error = now - memory.seen[0], 0.0, 0.0, 0.0
    for i in range(team.n):
        way = memory.q[i] - memory.q_seen[i]
        natural += applied[0, i] * way
        beyond += applied[1, i] * way
        error += (applied[0, i] + applied[1, i]) * (way - elapsed * memory.v_seen[i])
    meter.naive[0] += error
    natural -= terms.energies[LIFTED] - memory.seen[1]
    impedance_force(team, terms, 1.0, memory.force[0])
    complete_force(team, terms, law == PAPER, memory.force[0], memory.force[1])
    demand = power(team, terms, memory.force[1])
    U, V = potential(team, terms), storage(team, terms)
    interval = Interval(elapsed, natural, beyond, 0.0, U, U, 0.0, V, demand)
    return gates_of(law, account_step(tank, interval, settings))


@compiled
def see(team: TeamArrays, terms: Terms, memory: Memory, now: float) -> None:
    """Remembers the state that has arrived."""
    copy(memory.q, memory.q_seen)
    copy(memory.v, memory.v_seen)
    memory.seen[0], memory.seen[1] = now, terms.energies[LIFTED]


@compiled
def stored(terms: Terms, tank: Any) -> float:
    """W, the storage of the port [J]."""
    return terms.energies[KINETIC] + tank.grip * tank.potential + tank.reserve + tank.level


@compiled
def weigh(terms: Terms, memory: Memory, tank: Any, meter: Meter) -> None:
    """Residual and what it is compared with, where the account is up to date."""
    supplied = -(memory.outside[0] + memory.outside[1] - memory.began[1]) - memory.heat[0]
    meter.now[0] = stored(terms, tank) - memory.began[0] - supplied
    meter.residual[0] = max(meter.residual[0], meter.now[0])
    meter.mismatch[0] = max(meter.mismatch[0], abs(meter.now[0] + tank.lost))
    meter.sampling[0] = max(meter.sampling[0], abs(meter.naive[0]))
