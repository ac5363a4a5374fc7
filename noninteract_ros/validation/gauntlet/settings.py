# SPDX-License-Identifier: Apache-2.0
"""What a user can choose of a gauntlet."""

import os
from dataclasses import dataclass, field

from noninteract_ros.control.energy.tank import TankSettings
from noninteract_ros.errors import ScenarioError, one_of

# In the order of the compiled law's numbers.
LAWS = ("natural", "noninteracting", "paper", "energy_gated")
GUARANTEED = ("natural", "energy_gated")  # laws that claim to be passive where they are touched


@dataclass(frozen=True)
class GauntletSettings:
    """Which cases, which laws, and what lies between states and torques.

    Attributes:
        cases: Number of cases.
        seed: Seed of all of them.
        laws: Laws to be judged.
        delay: Ticks between a state and the torque that answers it.
        drop: Share of the states that do not arrive.
        rate: Ticks per second [Hz].
        horizon: How long a case may take to come to rest [s].
        jobs: Cases that run at a time; 0: one per processor.
        only: Number of a single case to be told in full, or None.
        tank: Settings of the account.
    """

    cases: int = 1000
    seed: int = 0
    laws: tuple[str, ...] = LAWS
    delay: int = 0
    drop: float = 0.0
    rate: float = 1000.0
    horizon: float = 4000.0
    jobs: int = 0
    only: int | None = None
    tank: TankSettings = field(default_factory=TankSettings)

    def __post_init__(self) -> None:
        for law in self.laws:
            if law not in LAWS:
                raise ScenarioError("--law", law, one_of(LAWS, law))
        if not 0.0 <= self.drop < 1.0:
            raise ScenarioError("--drop", self.drop, "at least 0 and below 1")
        if not self.rate > 0.0:
            raise ScenarioError("--rate", self.rate, "> 0")
        if not self.horizon > 0.0:
            raise ScenarioError("--horizon", self.horizon, "> 0")

    @property
    def period(self) -> float:
        """Time from tick to tick [s]."""
        return 1.0 / self.rate

    @property
    def reaction(self) -> float:
        """Mean age of the torque that acts: half a tick and the delay [s]."""
        return (self.delay + 0.5) * self.period

    @property
    def workers(self) -> int:
        """Cases that run at a time."""
        return self.jobs or os.cpu_count() or 1
