# SPDX-License-Identifier: Apache-2.0
"""Conditions of singularities, limits and gates, in words and numbers for diagnostics."""

from collections.abc import Iterator, Sequence

from noninteract_ros.control.energy.account import EnergyAccount
from noninteract_ros.control.tick import Tick

LINGER = 1.0  # [s] for which a condition is reported after it last held, against flicker
RELEASED = 0.1  # nu below which springs hold next to nothing


class LimitActivity:
    """Collects conditions over many ticks.

    Args:
        joint_names: Names of the team's joints.

    Attributes:
        interventions: Number of ticks so far whose torque was another one than the law's.
        transitions: Number of ticks so far in which a change of law or gains, a stop or a new
            start had a part.
    """

    def __init__(self, joint_names: Sequence[str]) -> None:
        self._joints = joint_names
        self.interventions = self.transitions = 0
        self._last: dict[str, float] = {}
        self._lowest: dict[str, float] = {}

    def reset(self) -> None:
        """Drop all conditions, as when the team's clock starts anew."""
        self._last.clear()

    def record(self, now: float, tick: Tick) -> None:
        """Add one tick, at the team's time [s]."""
        self.interventions += tick.intervened
        self.transitions += tick.in_transition
        for name, share in self._shares(tick):
            self._lowest[name] = min(share, self._lowest.get(name, share))
        if tick.intervened:
            self._last |= dict.fromkeys(self._texts(tick), now)

    def conditions(self, now: float) -> list[str]:
        """Return what holds at the team's time [s], or did until lately, in words."""
        return [text for text, last in list(self._last.items()) if now - last <= LINGER]

    def values(self) -> dict[str, float]:
        """Return lowest shares and regularity since the last call, and the interventions."""
        values, self._lowest = self._lowest, {}
        return values | {"interventions": self.interventions}

    @staticmethod
    def _shares(tick: Tick) -> Iterator[tuple[str, float]]:
        yield "law share, lowest", tick.law_share
        yield "regularity, lowest", tick.regularity
        yield "effort share, lowest", tick.safety.effort_share
        yield "torque rate share, lowest", tick.safety.rate_share
        if tick.walls is not None and tick.walls.nearest:
            yield "clearance, lowest [m]", tick.walls.least
        if tick.account.gated:
            yield "sigma, lowest", tick.account.sigma
            yield "nu, lowest", tick.account.tank.nu
            yield "damping, lowest", tick.account.tank.damping

    def _texts(self, tick: Tick) -> Iterator[str]:
        safety = tick.safety
        if not safety.finite:
            yield "the law gives no finite torque: braking"
        if tick.law_share < 1.0:
            yield "near a singularity: recovering"
        if safety.effort_share < 1.0 or safety.clipped:
            yield "at effort limits"
        if safety.rate_share < 1.0 or safety.rate_fit < 1.0:
            yield "at the torque-rate limit"
        yield from _gates(tick.account, tick.law_share * safety.shares.springs)
        for joint in safety.repelled:
            yield f"{self._joints[joint]} at its position limit"
        if tick.walls is not None and tick.walls.active:
            yield f"walls push: {tick.walls.nearest or 'joints at their limits'}"
        for joint in safety.too_fast:
            yield f"{self._joints[joint]} too fast"


def _gates(account: EnergyAccount, allowed: float) -> Iterator[str]:
    """Yield what the energy account holds back where limits leave the springs whole."""
    if not account.gated:
        return
    tank = account.tank
    if tank.sigma < 1.0:
        yield "decoupling reduced since the energy tank was low: damping or ~/refill restores it"
    if tank.nu < 1.0 and allowed == 1.0:
        if tank.nu <= RELEASED:
            yield "energy reserve spent: springs released, damping and gravity compensation hold"
        else:
            yield "energy reserve low: springs yield"
    if tank.damping < 1.0:
        yield "dampers feed motions since torques come late: damping reduced"
