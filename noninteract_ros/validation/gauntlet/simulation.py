# SPDX-License-Identifier: Apache-2.0
"""Compiled simulation of one case: law, energy account, delay, lost states and plant."""

from typing import Any

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.validation.gauntlet.account import full_tank
from noninteract_ros.validation.gauntlet.accounting import (
    book,
    sigma_of,
    store_state,
    stored,
    update_residual,
)
from noninteract_ros.validation.gauntlet.arrays import (
    SurroundingsArrays,
    TeamArrays,
    compiled,
    copy,
    dot,
    multiply_transposed,
)
from noninteract_ros.validation.gauntlet.law import (
    GRAVITATIONAL,
    KINETIC,
    Terms,
    complete_force,
    impedance_force,
    observe,
    potential,
)
from noninteract_ros.validation.gauntlet.plant import PlantArrays, advance, environment_energy
from noninteract_ros.validation.gauntlet.state import (
    ESCAPED,
    NATURAL,
    PAPER,
    SETTLED,
    STRETCHED,
    TRACED,
    UNBOUNDED,
    UNSETTLED,
    DelayedLink,
    Limits,
    Memory,
    Meter,
)


@compiled
def command(
    team: TeamArrays, terms: Terms, law: int, memory: Memory, tank: Any, to: Array
) -> None:
    """Write the torques of impedance plus gravity, decoupling and D de/dt, shape (3, n)."""
    pull, beyond = memory.force
    for i in range(team.n):
        pull[i] = team.damping[i] * terms.e_rate[i]
    multiply_transposed(terms.J, pull, to[2])
    impedance_force(team, terms, tank.nu, tank.damping, pull)
    multiply_transposed(terms.J, pull, to[0])
    if law != NATURAL:
        complete_force(team, terms, law == PAPER, pull, beyond)
        multiply_transposed(terms.J, beyond, to[1])
    for i in range(team.n):
        to[0, i] += terms.gravity[i]
        to[1, i] *= sigma_of(law, tank)


@compiled
def update_meter(meter: Meter, law: int, tank: Any, speed: float) -> None:
    """Update the statistics of a tick."""
    sigma = sigma_of(law, tank)
    meter.peak[0], meter.last[0] = max(meter.peak[0], speed), max(meter.last[0], speed)
    meter.sums[0] += sigma
    meter.sums[1] += 1.0 if sigma >= 1.0 else 0.0
    meter.sums[2] += 1.0
    meter.least[0] = min(meter.least[0], sigma)
    meter.least[1] = min(meter.least[1], tank.nu)
    meter.least[2] = min(meter.least[2], tank.level)


@compiled
def verdict_of(
    team: TeamArrays, terms: Terms, memory: Memory, k: int, limits: Limits, meter: Meter
) -> int:
    """Return the outcome of the case after k ticks; UNSETTLED while undecided."""
    now = terms.energies[KINETIC] + memory.environment[0] + memory.environment[1]
    if not now <= limits.growth * (memory.began[0] + memory.began[1]):
        return UNBOUNDED
    for i in range(len(team.arms)):
        if abs(np.sin(memory.q[2 * i + 1])) < STRETCHED:
            return ESCAPED
    if k % limits.window == limits.window - 1:
        fastest = max(meter.last[0], meter.before[0])
        if k >= limits.least and fastest <= limits.quiet * meter.peak[0]:
            return SETTLED
        if k < limits.most - 1:
            meter.before[0], meter.last[0] = meter.last[0], 0.0
    return UNSETTLED


@compiled
def move(
    plant: PlantArrays,
    team: TeamArrays,
    around: SurroundingsArrays,
    terms: Terms,
    T: float,
    memory: Memory,
    meter: Meter,
) -> None:
    """Advance the plant by one tick, with its heat and energy error."""
    n = team.n
    before = (
        terms.energies[KINETIC]
        + terms.energies[GRAVITATIONAL]
        + memory.environment[0]
        + memory.environment[1]
    )
    work = -dot(memory.torque, memory.q, n)
    lost = advance(plant, team, around, T, memory.q, memory.v, memory.torque)
    work += dot(memory.torque, memory.q, n)
    memory.heat[0] += lost
    observe(team, terms, memory.q, memory.v)
    memory.environment[0], memory.environment[1] = environment_energy(
        plant, team, around, memory.q, memory.v
    )
    after = (
        terms.energies[KINETIC]
        + terms.energies[GRAVITATIONAL]
        + memory.environment[0]
        + memory.environment[1]
    )
    meter.imbalance[0] += abs(after - before + lost - work)


@compiled
def record(
    row: Array, t: float, law: int, tank: Any, terms: Terms, memory: Memory, meter: Meter
) -> None:
    """Write a row of a trace: time, gates, account, energies, residual, q, v, torque."""
    row[0], row[1], row[2], row[3], row[4] = (
        t,
        sigma_of(law, tank),
        tank.nu,
        tank.level,
        tank.reserve,
    )
    row[5], row[6], row[7] = tank.lost, tank.potential, terms.energies[KINETIC]
    row[8], row[9] = memory.environment[0] + memory.environment[1], meter.now[0]
    m, n = len(memory.q), len(memory.torque)
    for i in range(m):
        row[TRACED + i], row[TRACED + m + i] = memory.q[i], memory.v[i]
    for i in range(n):
        row[TRACED + 2 * m + i] = memory.torque[i]


@compiled
def begin(
    plant: PlantArrays,
    team: TeamArrays,
    around: SurroundingsArrays,
    terms: Terms,
    law: int,
    memory: Memory,
    settings: Any,
) -> Any:
    """Return the initial account and initialize the memory."""
    observe(team, terms, memory.q, memory.v)
    tank = full_tank(settings, potential(team, terms))
    memory.environment[0], memory.environment[1] = environment_energy(
        plant, team, around, memory.q, memory.v
    )
    memory.began[0] = stored(terms, tank)
    memory.began[1] = memory.environment[0] + memory.environment[1]
    for slot in range(len(memory.pending)):
        copy(terms.gravity, memory.pending[slot, 0])
    store_state(team, terms, memory, 0.0)
    return tank


@compiled
def run(
    team: TeamArrays,
    around: SurroundingsArrays,
    plant: PlantArrays,
    terms: Terms,
    law: int,
    settings: Any,
    withheld: Any,
    link: DelayedLink,
    limits: Limits,
    memory: Memory,
    meter: Meter,
    trace: Array,
    stride: int,
) -> tuple[int, int, Any]:
    """Run one case until it is at rest, grows without bound or reaches the time limit.

    Args:
        team: The robots.
        around: Environment.
        plant: Dynamics of robots and environment.
        terms: Work space for the terms of the law, from `law.new_terms`.
        law: NATURAL, NONINTERACTING, PAPER or GATED.
        settings: Settings of the account.
        withheld: Settings without refilling, for the torques before the first command.
        link: Delay and losses between states and torques.
        limits: Limits of the simulation.
        memory: State of the loop, from `new_memory`.
        meter: Measurements, from `new_meter`.
        trace: Rows to fill, shape (rows, TRACED + 2 m + n).
        stride: Ticks from row to row.

    Returns:
        SETTLED, UNBOUNDED, UNSETTLED or ESCAPED, the number of ticks, and the account.
    """
    np.random.seed(link.seed)
    slots = link.delay + 1
    tank = begin(plant, team, around, terms, law, memory, settings)
    for k in range(limits.most):
        now, newest, last = k * link.period, (k + link.delay) % slots, (k + slots - 1) % slots
        if k == 0 or link.lost == 0.0 or np.random.random() >= link.lost:
            if k:
                applied = memory.pending[last]
                chosen = settings if k > link.delay else withheld
                tank = book(team, terms, law, memory, applied, now, tank, chosen, meter)
                update_residual(terms, memory, tank, meter)
                store_state(team, terms, memory, now)
            command(team, terms, law, memory, tank, memory.pending[newest])
        elif link.delay:  # Repeat the last command.
            before = (newest + slots - 1) % slots
            copy(memory.pending[before, 0], memory.pending[newest, 0])
            copy(memory.pending[before, 1], memory.pending[newest, 1])
            copy(memory.pending[before, 2], memory.pending[newest, 2])
        for i in range(team.n):
            memory.torque[i] = memory.pending[k % slots, 0, i] + memory.pending[k % slots, 1, i]
        update_meter(
            meter, law, tank, np.sqrt(2.0 * (terms.energies[KINETIC] + memory.environment[1]))
        )
        if k % stride == 0 and k // stride < len(trace):
            record(trace[k // stride], now, law, tank, terms, memory, meter)
        verdict = verdict_of(team, terms, memory, k, limits, meter)
        if verdict != UNSETTLED:
            return verdict, k + 1, tank
        move(plant, team, around, terms, link.period, memory, meter)
    return UNSETTLED, limits.most, tank
