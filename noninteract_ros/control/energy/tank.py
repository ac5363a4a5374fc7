# SPDX-License-Identifier: Apache-2.0
"""The energy account of a team: a tank for the decoupling, a reserve for everything else.

Symbols and proofs are those of docs/derivations.md. Nothing here knows a robot: work that was
measured over an interval goes in, the gates that scale the torque come out. All functions are pure
and take numbers only, so that numba compiles them as they stand; the gauntlet does.
"""

from dataclasses import dataclass
from typing import NamedTuple

from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import key

DAMPER_TRIAL = 0.05  # share of the dampers that is judged where the gate leaves less of them


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
        """Refuse levels that could never be reached or that would let sigma breathe.

        Raises:
            ScenarioError: Not initial <= capacity, full_gate < reopening_level <= capacity.
        """
        if self.initial > self.capacity:
            allowed = f"<= capacity ({self.capacity:g})"
            raise ScenarioError("tank.initial", self.initial, allowed)
        if not self.full_gate < self.reopening_level <= self.capacity:
            allowed = f"above full_gate ({self.full_gate:g}), <= capacity ({self.capacity:g})"
            raise ScenarioError("tank.reopening_level", self.reopening_level, allowed)


class TankLevels(NamedTuple):
    """The settings of an account as numbers; see `TankSettings`.

    Attributes:
        credit: kappa, energy granted per energy that references bring.
    """

    capacity: float
    initial: float
    reserve: float
    refill_fraction: float
    full_gate: float
    look_ahead: float
    reopening_level: float
    opening_rate: float
    closing_rate: float
    credit: float


class EnergyTank(NamedTuple):
    """State of the account. Storage of the port is T + nu U + V + reserve + level.

    Attributes:
        level: E, energy for the decoupling [J]; at most the capacity plus what was granted to
            references still under way.
        reserve: R, energy for all other forces of the controller [J].
        sigma: Gate of the decoupling, 0 to 1.
        nu: Gate of the springs, 0 to 1; exactly 1 while half of the reserve is there.
        damping: Gate of the dampers, 0 to 1; exactly 1 unless dampers that act late feed motions.
        dampers: What the dampers may still feed before their gate closes [J].
        owed: Energy that must come in before sigma may rise [J]; what the decoupling returns of
            the energy that it was lent does not count.
        potential: U at the last step [J].
        margins: V at the last step, the potential of the joint limits' margins [J].
        lost: Energy withheld or spilt since the start [J]; never falls.
        granted: Credit given for references since the start [J].
        brought: Energy that references brought since the start, net [J].
        peak: Largest `brought` so far [J].
        refilled: Energy that an operator granted since the start [J].
    """

    level: float
    reserve: float
    sigma: float
    nu: float
    damping: float
    dampers: float
    owed: float
    potential: float
    margins: float
    lost: float
    granted: float
    brought: float
    peak: float
    refilled: float


class Interval(NamedTuple):
    """Measurements of the time since the last step.

    Attributes:
        step: Length [s].
        decoupling_work: Work of all forces that the tank pays, as they were applied [J].
        other_work: Work of all other forces, less what it lifted of the robots' weight [J].
        damped: Energy that the dampers would have absorbed with their gate open [J].
        arrived: U where the motion arrived, the references followed as predicted [J].
        potential: U now, after the references moved to where they are [J].
        margins: V now [J].
        led: Energy that references and force inputs brought beyond the change of nu U [J].
        storage: V_s, sum of the subtasks' storage functions (32) now [J].
        demand: Power that complete decoupling would inject now [W].
    """

    step: float
    decoupling_work: float
    other_work: float
    damped: float
    arrived: float
    potential: float
    margins: float
    led: float
    storage: float
    demand: float


def levels(settings: TankSettings, credit: float, refills: bool = True) -> TankLevels:
    """Return the settings as numbers.

    Args:
        settings: The settings.
        credit: kappa.
        refills: False where what is absorbed is not to refill the tank.
    """
    return TankLevels(
        capacity=float(settings.capacity),
        initial=float(settings.initial),
        reserve=float(settings.reserve),
        refill_fraction=float(settings.refill_fraction) if refills else 0.0,
        full_gate=float(settings.full_gate),
        look_ahead=float(settings.look_ahead),
        reopening_level=float(settings.reopening_level),
        opening_rate=float(settings.opening_rate),
        closing_rate=float(settings.closing_rate),
        credit=float(credit),
    )


def full_tank(limits: TankLevels, potential: float) -> EnergyTank:
    """Return a fresh account, with the potential U [J] of the errors that it begins with."""
    return EnergyTank(
        level=limits.initial,
        reserve=limits.reserve,
        sigma=1.0,
        nu=1.0,
        damping=1.0,
        dampers=limits.reserve,
        owed=0.0,
        potential=potential,
        margins=0.0,
        lost=0.0,
        granted=0.0,
        brought=0.0,
        peak=0.0,
        refilled=0.0,
    )


def carry(tank: EnergyTank, limits: TankLevels, potential: float, margins: float) -> EnergyTank:
    """Return the same account at the start of new sums, where a state does not follow.

    Energies and gates go on, but no more than a fresh account has, and so does what references
    must bring before they earn credit.

    Args:
        tank: The account.
        limits: Its levels.
        potential: U of the errors that the new sums begin with [J].
        margins: V there [J].
    """
    return EnergyTank(
        level=min(tank.level, limits.initial),
        reserve=min(tank.reserve, limits.reserve),
        sigma=tank.sigma,
        nu=tank.nu,
        damping=tank.damping,
        dampers=tank.dampers,
        owed=tank.owed,
        potential=potential,
        margins=margins,
        lost=0.0,
        granted=0.0,
        brought=0.0,
        peak=tank.peak - tank.brought,
        refilled=0.0,
    )


def refill(tank: EnergyTank, limits: TankLevels) -> EnergyTank:
    """Fill tank and reserve on purpose; nothing is owed, sigma opens at its own rate."""
    level = max(tank.level, limits.capacity)
    reserve = max(tank.reserve, limits.reserve)
    refilled = tank.refilled + (level - tank.level) + (reserve - tank.reserve)
    return tank._replace(
        level=level, reserve=reserve, dampers=limits.reserve, owed=0.0, refilled=refilled
    )


def revalue(tank: EnergyTank, potential: float) -> EnergyTank:
    """Take what other gains change in U from the tank, or give it back to the reserve.

    Args:
        tank: The account.
        potential: U of the same error under the new gains [J].
    """
    cost = tank.nu * (potential - tank.potential)
    paid = max(cost, 0.0)
    level, reserve = tank.level - paid, tank.reserve + (paid - cost)
    return tank._replace(level=level, reserve=reserve, potential=potential)


def deepen(tank: EnergyTank, margins: float) -> EnergyTank:
    """Pay for margins of joint limits that reach further out, with V [J] at the same state."""
    return tank._replace(level=tank.level - (margins - tank.margins), margins=margins)


def loosen(tank: EnergyTank, nu: float) -> EnergyTank:
    """Leave a smaller share of the springs in force; what they give up goes to the reserve."""
    return tank._replace(nu=nu, reserve=tank.reserve + (tank.nu - nu) * tank.potential)


def affordable(tank: EnergyTank, cost: float, limits: TankLevels) -> float:
    """Return the share of a change with a cost [J] that leaves the gate open, 0 to 1."""
    spare = tank.level - limits.full_gate
    return 1.0 if cost <= 0.0 else min(1.0, max(0.0, spare) / cost)


def step(tank: EnergyTank, interval: Interval, limits: TankLevels) -> EnergyTank:
    """Book one interval and set all gates for the next one, (C2) and (C3)."""
    # Works: what springs and margins store beyond the work on them is none of the reserve's.
    absorbed = -interval.other_work - tank.nu * (interval.arrived - tank.potential)
    absorbed -= interval.margins - tank.margins
    reserve = tank.reserve + absorbed
    # What springs have given up waits in the reserve until they are back.
    full = limits.reserve + (1.0 - tank.nu) * interval.arrived
    surplus = max(reserve - full, 0.0)
    share = limits.refill_fraction * surplus
    offered = tank.level - interval.decoupling_work + share
    # Credit lapses as the motion that it was granted for decays.
    level = min(offered, limits.capacity + 2.0 * limits.credit * interval.storage)
    lost = tank.lost + ((surplus - share) + (offered - level))
    # References: never twice for the same.
    moved = tank.nu * (interval.potential - interval.arrived) + interval.led
    brought = tank.brought + moved
    peak = max(tank.peak, brought)
    credit = limits.credit * (peak - tank.peak)
    level += credit
    owed = max(max(tank.owed - share, 0.0) - credit, 0.0)
    # Gates.
    purse = (reserve - surplus) + tank.nu * interval.potential
    nu = _unit(purse / (interval.potential + 0.5 * limits.reserve))
    fed = tank.dampers + max(tank.damping, DAMPER_TRIAL) * interval.damped
    dampers = min(fed, limits.reserve)
    needed = limits.full_gate + limits.look_ahead * abs(interval.demand)
    # What an unstable motion returns on its way back must not reopen the gate.
    short = level < limits.reopening_level
    rise = 0.0 if short or owed > 0.0 else limits.opening_rate * interval.step
    lowest = tank.sigma - limits.closing_rate * interval.step
    sigma = min(max(_unit(level / needed), lowest), tank.sigma + rise)
    if short and sigma < tank.sigma:
        owed = max(owed, limits.reopening_level - limits.full_gate)
    return EnergyTank(
        level=level,
        reserve=purse - nu * interval.potential,  # A spring that yields gives back its energy.
        sigma=sigma,
        nu=nu,
        damping=_unit(dampers / (0.5 * limits.reserve)),
        dampers=dampers,
        owed=owed,
        potential=interval.potential,
        margins=interval.margins,
        lost=lost,
        granted=tank.granted + credit,
        brought=brought,
        peak=peak,
        refilled=tank.refilled,
    )


def whole(tank: EnergyTank, before: EnergyTank) -> EnergyTank:
    """Return the account of a law without gates: springs and dampers whole, sigma as it was.

    Springs that effort limits had loosened come back as far as the reserve pays.

    Args:
        tank: The account.
        before: The same a step ago.
    """
    purse = tank.reserve + tank.nu * tank.potential
    nu = 1.0
    if before.nu < 1.0 and purse < tank.potential:
        nu = max(purse, 0.0) / tank.potential
    return EnergyTank(
        level=tank.level,
        reserve=purse - nu * tank.potential,
        sigma=tank.sigma,
        nu=nu,
        damping=1.0,
        dampers=tank.dampers,
        owed=tank.owed,
        potential=tank.potential,
        margins=tank.margins,
        lost=tank.lost,
        granted=tank.granted,
        brought=tank.brought,
        peak=tank.peak,
        refilled=tank.refilled,
    )


def _unit(value: float) -> float:
    return min(max(value, 0.0), 1.0)
