# SPDX-License-Identifier: Apache-2.0
"""State of the energy account at the port where a team is touched."""

from dataclasses import dataclass

import numpy as np

from noninteract_ros.control.energy.tank import EnergyTank

# Published of an account on the topic `energy`, in this order.
QUANTITIES = (
    "storage",
    "supplied",
    "dissipated",
    "demand",
    "tank",
    "owed",
    "reserve",
    "sigma",
    "nu",
    "residual",
    "received",
    "measured",
    "brought",
    "credit",
    "refilled",
    "lost",
    "account",
)
MODEL_ERROR = 0.5  # [J] between both ways to know what was received, beyond which it is named
MODEL_SHARE = 0.1  # the same of the energy that went to and fro
ROUNDING = 16.0 * float(np.finfo(float).eps)  # of what was added up, for the residual


@dataclass(frozen=True, slots=True)
class EnergyAccount:
    """The account at one tick.

    Attributes:
        tank: Energies and gates.
        kinetic: T = s' M s / 2, s the velocity beyond that of the references [J].
        dissipated: Power that the dampers in force absorb [W].
        demand: P, power that complete decoupling would inject [W].
        received: Work of the environment since the account began: what T grew by less the work
            of the torques that were applied, both measured [J].
        start: W when the account began [J].
        turnover: Sum of the sizes of everything that was added up [J].
        number: Number of the account; all sums begin anew with it.
        fixed: sigma of a law without gates; None where the gates are in force.
    """

    tank: EnergyTank
    kinetic: float
    dissipated: float
    demand: float
    received: float
    start: float
    turnover: float
    number: int
    fixed: float | None

    @property
    def gated(self) -> bool:
        """True where the law in force has gates."""
        return self.fixed is None

    @property
    def sigma(self) -> float:
        """Gate of the decoupling in force, 0 to 1."""
        return self.tank.sigma if self.fixed is None else self.fixed

    @property
    def closing(self) -> bool:
        """True where a gate leaves less than the whole law in force."""
        tank = self.tank
        return self.gated and (tank.sigma < 1.0 or tank.nu < 1.0 or tank.damping < 1.0)

    @property
    def storage(self) -> float:
        """T + nu U + V [J]."""
        return self.kinetic + self.tank.nu * self.tank.potential + self.tank.margins

    @property
    def whole(self) -> float:
        """W, the storage function of the port: T + nu U + V + R + E [J]."""
        return self.storage + self.tank.reserve + self.tank.level

    @property
    def residual(self) -> float:
        """Growth of W beyond all that came in, -L and never positive but for rounding [J]."""
        tank = self.tank
        came_in = self.received + tank.brought + tank.granted + tank.refilled
        return self.whole - self.start - came_in

    @property
    def imbalance(self) -> float:
        """Residual beyond the loss that was booked, zero but for rounding [J]."""
        return self.residual + self.tank.lost

    @property
    def bound(self) -> float:
        """Largest imbalance that rounding alone can make [J]."""
        return ROUNDING * self.turnover

    @property
    def sound(self) -> bool:
        """True where rounding explains the imbalance; False where it is no number."""
        return abs(self.imbalance) <= self.bound


def model_error_text(account: EnergyAccount, measured: float, exchanged: float) -> str:
    """Return a sentence where forces and motion disagree on the received energy, or "".

    `received` follows from the motion under the torques that were applied, as the model of the
    robots has it; `measured` from force sensors or a momentum observer. Only a wrong model, a
    contact that no sensor measures, or torques that were not applied as known part them.

    Args:
        account: The account at a tick.
        measured: Integral of the measured power since the account began [J].
        exchanged: Integral of its size [J].
    """
    error = account.received - measured
    if abs(error) <= MODEL_ERROR + MODEL_SHARE * exchanged:
        return ""
    return (
        f"received {account.received:.3g} J by the motion, {measured:.3g} J by the forces: wrong "
        "model, contact without a sensor, or torques not as known"
    )


def quantities(account: EnergyAccount, supplied: float, measured: float) -> tuple[float, ...]:
    """Return the numbers of `QUANTITIES`, in their order.

    Args:
        account: The account at a tick.
        supplied: Power at the port, as forces are measured or estimated [W].
        measured: Its integral since the account began [J].
    """
    tank = account.tank
    return (
        account.storage,
        supplied,
        account.dissipated,
        account.demand,
        tank.level,
        tank.owed,
        tank.reserve,
        account.sigma,
        tank.nu,
        account.residual,
        account.received,
        measured,
        tank.brought,
        tank.granted,
        tank.refilled,
        tank.lost,
        account.number,
    )
