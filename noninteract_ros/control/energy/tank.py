# SPDX-License-Identifier: Apache-2.0
"""The energy account of the gated law: a tank for the decoupling, a reserve for the impedance.

Symbols and proofs are those of docs/derivations.md. Nothing here knows a robot: work that was
measured over an interval goes in, the two gates that scale the torque come out. All amounts may be
arrays over many cases instead of numbers.
"""

from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import key

Amount = TypeVar("Amount", float, Array)


@dataclass(frozen=True)
class TankSettings:
    """Configuration block of the energy account."""

    capacity: float = key("Most energy that the tank keeps [J]", 2.0, positive=True, live=True)
    initial: float = key("Energy in the tank at the start [J]", 1.0, minimum=0.0)
    reserve: float = key(
        "Energy that sampling and delay may cost the impedance before it yields [J]",
        2.0,
        positive=True,
        live=True,
    )
    refill_fraction: float = key(
        "Share of the energy that the impedance absorbs which refills the tank",
        0.5,
        minimum=0.0,
        maximum=0.95,
        live=True,
    )
    full_gate: float = key(
        "Level from which decoupling is complete [J]", 0.25, positive=True, live=True
    )
    look_ahead: float = key(
        "Time for which the power wanted now must be in the tank [s]",
        0.01,
        minimum=0.0,
        live=True,
    )
    reopening_level: float = key(
        "Level from which sigma rises, when what it is above full_gate has come in anew [J]",
        1.0,
        minimum=0.0,
        live=True,
    )
    opening_rate: float = key("Fastest rise of sigma [1/s]", 2.0, positive=True, live=True)
    closing_rate: float = key("Fastest fall of sigma [1/s]", 300.0, positive=True, live=True)
    reference_credit: float = key(
        "Tank energy granted per energy that moved references bring, for each further subtask",
        1.0,
        minimum=0.0,
        live=True,
    )

    observer_gain: float = key(
        "Bandwidth of the momentum observer, where no force is measured [1/s]", 50.0, positive=True
    )

    def check(self) -> None:
        """Refuses levels that could never be reached or that would let sigma breathe.

        Raises:
            ScenarioError: Not initial <= capacity, full_gate < reopening_level <= capacity.
        """
        if self.initial > self.capacity:
            allowed = f"<= capacity ({self.capacity:g})"
            raise ScenarioError("tank.initial", self.initial, allowed)
        if not self.full_gate < self.reopening_level <= self.capacity:
            allowed = f"above full_gate ({self.full_gate:g}), <= capacity ({self.capacity:g})"
            raise ScenarioError("tank.reopening_level", self.reopening_level, allowed)


@dataclass(frozen=True, slots=True)
class EnergyTank(Generic[Amount]):
    """What the account remembers. Storage of the port is T + grip U + reserve + level.

    Attributes:
        level: E, energy for the decoupling [J]; at most the capacity plus what was granted to
            references still under way.
        reserve: R, energy for the impedance's own sampling errors [J].
        sigma: Gate of the decoupling, 0 to 1.
        grip: Gate nu of the impedance, 0 to 1; exactly 1 while half of the reserve is there.
        owed: Energy that must come in before sigma may rise [J]; what the decoupling returns of
            the energy that it was lent does not count.
        potential: U at the last step [J].
        lost: Energy withheld or spilt since the start [J]; never falls.
        granted: Credit given for references since the start [J].
        brought: Energy that references brought since the start, net [J].
        peak: Largest `brought` so far [J].
        refilled: Energy that an operator granted since the start [J].
    """

    level: Amount
    reserve: Amount
    sigma: Amount
    grip: Amount
    owed: Amount
    potential: Amount
    lost: Amount
    granted: Amount
    brought: Amount
    peak: Amount
    refilled: Amount


@dataclass(frozen=True, slots=True)
class Interval(Generic[Amount]):
    """What was measured since the last step.

    Attributes:
        step: Length [s].
        impedance_work: Work of the impedance force that was applied, grip included [J].
        decoupling_work: Work of the decoupling force that was applied, sigma included [J].
        input_work: Work of the sources' force inputs [J].
        arrived: U where the motion arrived, the references followed as they were foretold [J].
        potential: U now, after the references moved to where they are [J].
        kinetic_jump: What the same move changed in the kinetic energy of the error [J].
        storage: V_s, sum of the subtasks' storage functions (32) now [J].
        demand: Power that complete decoupling would inject now [W].
    """

    step: Amount
    impedance_work: Amount
    decoupling_work: Amount
    input_work: Amount
    arrived: Amount
    potential: Amount
    kinetic_jump: Amount
    storage: Amount
    demand: Amount


def full_tank(settings: TankSettings, potential: Amount) -> EnergyTank[Amount]:
    """A fresh account, with the potential U [J] of the errors that it begins with."""
    none = 0.0 * potential
    return EnergyTank(
        none + settings.initial,
        none + settings.reserve,
        none + 1.0,
        none + 1.0,
        none,
        potential,
        none,
        none,
        none,
        none,
        none,
    )


def refill(tank: EnergyTank[Amount], settings: TankSettings) -> EnergyTank[Amount]:
    """Fills tank and reserve on purpose; nothing is owed, the gates open at their own rates."""
    level = _greater(tank.level, settings.capacity)
    reserve = _greater(tank.reserve, settings.reserve)
    refilled = tank.refilled + (level - tank.level) + (reserve - tank.reserve)
    return replace(tank, level=level, reserve=reserve, owed=0.0 * level, refilled=refilled)


def revalue(tank: EnergyTank[Amount], potential: Amount) -> EnergyTank[Amount]:
    """Takes what other gains change in U from the tank, or gives it back to the reserve.

    Args:
        tank: The account.
        potential: U of the same error under the new gains [J].
    """
    cost = tank.grip * (potential - tank.potential)
    paid = _greater(cost, 0.0)
    return replace(
        tank,
        level=tank.level - paid,
        reserve=tank.reserve + (paid - cost),
        potential=potential,
    )


def affordable(tank: EnergyTank[float], cost: float, settings: TankSettings) -> float:
    """Share of a change with a cost [J], 0 to 1, that the tank can pay and still be open."""
    spare = tank.level - settings.full_gate
    return 1.0 if cost <= 0.0 else min(1.0, max(0.0, spare) / cost)


def step(
    tank: EnergyTank[Amount], interval: Interval[Amount], settings: TankSettings
) -> EnergyTank[Amount]:
    """Books one interval and sets both gates for the next one, (C2) and (C3)."""
    tank = _credit(_book(tank, interval, settings), interval, settings)
    purse = tank.reserve + tank.grip * interval.potential
    grip = _unit(purse / (interval.potential + 0.5 * settings.reserve))
    sigma, owed = _gate(tank, interval, settings)
    return replace(
        tank,
        grip=grip,
        reserve=purse - grip * interval.potential,  # A spring that yields gives back its energy.
        sigma=sigma,
        owed=owed,
        potential=interval.potential,
    )


def observed(tank: EnergyTank[Amount], sigma: float) -> EnergyTank[Amount]:
    """The account of a law that has no gates: sigma as it is there, and no yielding."""
    purse = tank.reserve + tank.grip * tank.potential
    whole = 0.0 * purse + 1.0
    return replace(tank, grip=whole, reserve=purse - tank.potential, sigma=sigma * whole)


def _book(
    tank: EnergyTank[Amount], interval: Interval[Amount], settings: TankSettings
) -> EnergyTank[Amount]:
    """Work of both forces; a reserve that is full passes a share on to the tank."""
    absorbed = -interval.impedance_work - tank.grip * (interval.arrived - tank.potential)
    reserve = tank.reserve + absorbed
    surplus = _greater(reserve - settings.reserve, 0.0)
    share = settings.refill_fraction * surplus
    offered = tank.level - interval.decoupling_work + share
    # Credit lapses as the motion that it was granted for decays.
    level = _less(offered, settings.capacity + 2.0 * settings.reference_credit * interval.storage)
    lost = (surplus - share) + (offered - level)
    return replace(
        tank,
        reserve=reserve - surplus,
        level=level,
        owed=_greater(tank.owed - share, 0.0),
        lost=tank.lost + lost,
    )


def _credit(
    tank: EnergyTank[Amount], interval: Interval[Amount], settings: TankSettings
) -> EnergyTank[Amount]:
    """Grants energy for what references have brought, never twice for the same."""
    moved = tank.grip * (interval.potential - interval.arrived) + interval.kinetic_jump
    brought = tank.brought + moved + interval.input_work
    peak = _greater(tank.peak, brought)
    credit = settings.reference_credit * (peak - tank.peak)
    return replace(
        tank,
        level=tank.level + credit,
        owed=_greater(tank.owed - credit, 0.0),
        granted=tank.granted + credit,
        brought=brought,
        peak=peak,
    )


def _gate(
    tank: EnergyTank[Amount], interval: Interval[Amount], settings: TankSettings
) -> tuple[Amount, Amount]:
    """Sigma for the next tick, and what must come in before it may rise."""
    needed = settings.full_gate + settings.look_ahead * abs(interval.demand)
    wanted = _unit(tank.level / needed)
    # What an unstable motion returns on its way back must not reopen the gate.
    short = tank.level < settings.reopening_level
    shut = short | (tank.owed > 0.0)
    highest = tank.sigma + settings.opening_rate * interval.step * (1.0 - shut)
    lowest = tank.sigma - settings.closing_rate * interval.step
    sigma = _less(_greater(wanted, lowest), highest)
    closes = short & (sigma < tank.sigma)
    quantum = settings.reopening_level - settings.full_gate
    return sigma, _greater(tank.owed, quantum * closes)


def _unit(value: Amount) -> Amount:
    return _less(_greater(value, 0.0), 1.0)


def _less(first: Amount, second: Amount | float) -> Amount:
    """The smaller one, element by element; for numbers without the detour over arrays."""
    if isinstance(first, np.ndarray) or isinstance(second, np.ndarray):
        return np.minimum(first, second)
    return min(first, second)


def _greater(first: Amount, second: Amount | float) -> Amount:
    """The greater one; see `_less`."""
    if isinstance(first, np.ndarray) or isinstance(second, np.ndarray):
        return np.maximum(first, second)
    return max(first, second)
