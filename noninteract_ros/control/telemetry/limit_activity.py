# SPDX-License-Identifier: Apache-2.0
"""What people are told of singularities and joint limits, so that it can be read."""

from collections.abc import Iterator, Sequence

from noninteract_ros.control.energy.account import EnergyAccount
from noninteract_ros.control.tick import Tick

LINGER = 1.0  # [s] for which a condition is told after it last held, so that it does not flicker


class LimitActivity:
    """Collects over many ticks what `Tick` says of each.

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
        """Starts anew, as the team's clock does."""
        self._last.clear()

    def note(self, now: float, tick: Tick) -> None:
        """Takes one tick, at the team's time [s]."""
        self.interventions += tick.intervened
        self.transitions += tick.in_transition
        for name, share in self._shares(tick):
            self._lowest[name] = min(share, self._lowest.get(name, share))
        if tick.intervened:
            self._last |= dict.fromkeys(self._texts(tick), now)

    def conditions(self, now: float) -> list[str]:
        """What holds at the team's time [s], or did until lately, in words."""
        return [text for text, last in list(self._last.items()) if now - last <= LINGER]

    def values(self) -> dict[str, float]:
        """Lowest shares and regularity since the last call, and the number of interventions."""
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
            yield "sigma, lowest", tick.account.tank.sigma
            yield "grip, lowest", tick.account.tank.grip

    def _texts(self, tick: Tick) -> Iterator[str]:
        safety = tick.safety
        if not safety.finite:
            yield "the law gives no finite torque: braking"
        if tick.law_share < 1.0:
            yield "near a singularity: recovering"
        if safety.effort_share < 1.0 or safety.clipped:
            yield "at effort limits"
        if safety.rate_share < 1.0:
            yield "at the torque-rate limit"
        yield from _gates(tick.account)
        for joint in safety.repelled:
            yield f"{self._joints[joint]} at its position limit"
        if tick.walls is not None and tick.walls.active:
            yield f"walls push: {tick.walls.nearest or 'joints at their limits'}"
        for joint in safety.too_fast:
            yield f"{self._joints[joint]} too fast"


def _gates(account: EnergyAccount) -> Iterator[str]:
    """What the energy account holds back."""
    if account.gated and account.tank.sigma < 1.0:
        yield "decoupling reduced since the energy tank was low: damping or ~/refill restores it"
    if account.gated and account.tank.grip < 1.0:
        yield "energy reserve low: impedance yields"
