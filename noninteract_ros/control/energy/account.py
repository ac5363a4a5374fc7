# SPDX-License-Identifier: Apache-2.0
"""What a controller knows of the energy at the port where its team is touched."""

from dataclasses import dataclass

import numpy as np

from noninteract_ros.control.energy.tank import EnergyTank

# What is told of an account, on the topic `energy`, in this order.
QUANTITIES = (
    "storage",
    "supplied",
    "dissipated",
    "demand",
    "tank",
    "owed",
    "reserve",
    "sigma",
    "grip",
    "residual",
    "received",
    "measured",
    "brought",
    "credit",
    "refilled",
    "lost",
    "account",
)
ROUNDING = 16.0 * float(np.finfo(float).eps)  # of what was added up, for the residual


@dataclass(frozen=True, slots=True)
class EnergyAccount:
    """The account at one tick.

    Attributes:
        tank: Energies and gates.
        kinetic: T = e_rate' Lambda e_rate / 2 [J].
        dissipated: nu e_rate' D e_rate [W].
        demand: P, power that complete decoupling would inject [W].
        received: Work of the surroundings since the account began: what T grew by less the work
            of the torques that were applied, both measured [J].
        start: W when the account began [J].
        turnover: Sum of the sizes of everything that was added up [J].
        number: Number of the account; all sums begin anew with it.
        gated: Whether the law in force has gates.
    """

    tank: EnergyTank[float]
    kinetic: float
    dissipated: float
    demand: float
    received: float
    start: float
    turnover: float
    number: int
    gated: bool

    @property
    def closing(self) -> bool:
        """Whether a gate leaves less than the whole law in force."""
        return self.gated and (self.tank.sigma < 1.0 or self.tank.grip < 1.0)

    @property
    def storage(self) -> float:
        """T + nu U [J]."""
        return self.kinetic + self.tank.grip * self.tank.potential

    @property
    def whole(self) -> float:
        """W, the storage function of the port: T + nu U + R + E [J]."""
        return self.storage + self.tank.reserve + self.tank.level

    @property
    def residual(self) -> float:
        """What W grew by beyond all that came in, -L and never positive but for rounding [J]."""
        tank = self.tank
        came_in = self.received + tank.brought + tank.granted + tank.refilled
        return self.whole - self.start - came_in

    @property
    def imbalance(self) -> float:
        """What the residual is beyond the loss that was booked, zero but for rounding [J]."""
        return self.residual + self.tank.lost

    @property
    def bound(self) -> float:
        """Largest imbalance that rounding alone can make [J]."""
        return ROUNDING * self.turnover

    @property
    def sound(self) -> bool:
        """Whether the imbalance is what rounding can make; not so, if it is no number."""
        return abs(self.imbalance) <= self.bound


def quantities(account: EnergyAccount, supplied: float, measured: float) -> tuple[float, ...]:
    """The numbers of `QUANTITIES`, in their order.

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
        tank.sigma,
        tank.grip,
        account.residual,
        account.received,
        measured,
        tank.brought,
        tank.granted,
        tank.refilled,
        tank.lost,
        account.number,
    )
