# SPDX-License-Identifier: Apache-2.0
"""Update of the energy account in the loop of a case, and its residual."""

from typing import Any

from noninteract_ros.arrays import Array
from noninteract_ros.control.energy.tank import Interval
from noninteract_ros.validation.gauntlet.account import account_step, whole
from noninteract_ros.validation.gauntlet.arrays import TeamArrays, compiled, copy
from noninteract_ros.validation.gauntlet.law import (
    GRAVITATIONAL,
    KINETIC,
    Terms,
    complete_force,
    impedance_force,
    potential,
    power,
    storage,
)
from noninteract_ros.validation.gauntlet.state import GATED, NATURAL, PAPER, Memory, Meter


@compiled
def gates_of(law: int, tank: Any, before: Any) -> Any:
    """Return the account with the gates of a law."""
    return tank if law == GATED else whole(tank, before)


@compiled
def sigma_of(law: int, tank: Any) -> float:
    """Return the gate of the decoupling in force."""
    if law == GATED:
        return tank.sigma
    return 0.0 if law == NATURAL else 1.0


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
    """Return the account after the interval since the last received state."""
    elapsed, natural, beyond, error, damped = now - memory.received[0], 0.0, 0.0, 0.0, 0.0
    for i in range(team.n):
        step = memory.q[i] - memory.q_received[i]
        natural += applied[0, i] * step
        beyond += applied[1, i] * step
        damped += applied[2, i] * step
        error += (applied[0, i] + applied[1, i]) * (step - elapsed * memory.v_received[i])
    meter.naive[0] += error
    natural -= terms.energies[GRAVITATIONAL] - memory.received[1]
    impedance_force(team, terms, 1.0, 1.0, memory.force[0])
    complete_force(team, terms, law == PAPER, memory.force[0], memory.force[1])
    demand = power(team, terms, memory.force[1])
    U, V = potential(team, terms), storage(team, terms)
    interval = Interval(
        step=elapsed,
        decoupling_work=beyond,
        other_work=natural,
        damped=damped,
        arrived=U,
        potential=U,
        margins=0.0,
        led=0.0,
        storage=V,
        demand=demand,
    )
    return gates_of(law, account_step(tank, interval, settings), tank)


@compiled
def store_state(team: TeamArrays, terms: Terms, memory: Memory, now: float) -> None:
    """Store the received state."""
    copy(memory.q, memory.q_received)
    copy(memory.v, memory.v_received)
    memory.received[0], memory.received[1] = now, terms.energies[GRAVITATIONAL]


@compiled
def stored(terms: Terms, tank: Any) -> float:
    """Return W, the storage of the port [J]."""
    return terms.energies[KINETIC] + tank.nu * tank.potential + tank.reserve + tank.level


@compiled
def update_residual(terms: Terms, memory: Memory, tank: Any, meter: Meter) -> None:
    """Update the residual and its comparison values with a current account."""
    supplied = -(memory.environment[0] + memory.environment[1] - memory.began[1]) - memory.heat[0]
    meter.now[0] = stored(terms, tank) - memory.began[0] - supplied
    meter.residual[0] = max(meter.residual[0], meter.now[0])
    meter.mismatch[0] = max(meter.mismatch[0], abs(meter.now[0] + tank.lost))
    meter.sampling[0] = max(meter.sampling[0], abs(meter.naive[0]))
