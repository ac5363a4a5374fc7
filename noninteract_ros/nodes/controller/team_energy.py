# SPDX-License-Identifier: Apache-2.0
"""The energy account of the whole team, published and in words."""

import numpy as np
from std_msgs.msg import Float64MultiArray

from noninteract_ros.arrays import Array
from noninteract_ros.clock import seconds
from noninteract_ros.control.energy.account import QUANTITIES, EnergyAccount, quantities
from noninteract_ros.control.tick import Tick
from noninteract_ros.nodes.common.node import LOOP_QOS, ScenarioNode
from noninteract_ros.nodes.messages.messages import EnergyCodec

LABELS = ("time", *QUANTITIES)


class TeamEnergy:
    """Publishes the account on `energy`, and adds up the power that is measured at the port.

    Args:
        node: The controller's node.
    """

    def __init__(self, node: ScenarioNode) -> None:
        self._codec = EnergyCodec(LABELS)
        self._to = node.create_publisher(Float64MultiArray, "energy", LOOP_QOS)
        self.forget()

    def forget(self) -> None:
        """Starts the sum anew."""
        self._last: tuple[float, float, int] | None = None
        self._measured = 0.0

    def publish(self, stamp: int, tick: Tick, external_torque: Array) -> None:
        """Tells the account of a tick, stamped as its state [ns].

        Args:
            stamp: Stamp [ns].
            tick: The tick.
            external_torque: tau_e as it is measured or estimated, shape (n,) [N or N m].
        """
        now, account = seconds(stamp), tick.account
        force = tick.dynamics.force_of(external_torque)
        supplied = float(tick.error.e_rate @ force)
        if self._last is None or self._last[2] != account.number:
            self._measured = 0.0
        else:
            before, power, _ = self._last
            self._measured += 0.5 * (now - before) * (power + supplied)
        self._last = (now, supplied, account.number)
        numbers = quantities(account, supplied, self._measured)
        self._to.publish(self._codec.encode(np.array((now, *numbers))))


def told(account: EnergyAccount) -> dict[str, object]:
    """The account for /diagnostics."""
    tank = account.tank
    return {
        "sigma": tank.sigma,
        "grip": tank.grip,
        "tank [J]": tank.level,
        "owed [J]": tank.owed,
        "reserve [J]": tank.reserve,
        "residual [J]": account.residual,
    }


def unsound(account: EnergyAccount) -> str:
    """What is wrong with an account that does not balance, or an empty text."""
    if account.sound:
        return ""
    found, bound = account.imbalance, account.bound
    return f"the energy account does not balance: {found:.3g} J, rounding makes {bound:.1g} J"
