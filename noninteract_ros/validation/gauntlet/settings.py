# SPDX-License-Identifier: Apache-2.0
"""Settings of the gauntlet."""

import os
from dataclasses import dataclass, field

from noninteract_ros.control.energy.tank import TankSettings
from noninteract_ros.errors import ScenarioError, one_of

# In the order of the compiled law's numbers.
LAWS = ("natural", "noninteracting", "paper", "energy_gated")
GUARANTEED = ("natural", "energy_gated")  # laws that are passive at the external port


@dataclass(frozen=True)
class GauntletSettings:
    """Cases, laws and link of a gauntlet.

    Attributes:
        cases: Number of cases.
        seed: Seed of all of them.
        laws: Laws to test.
        delay: Delay from a state to its torque [ticks].
        drop: Share of lost states.
        rate: Control rate [Hz].
        horizon: Largest duration of a case [s].
        jobs: Number of parallel cases; 0 for one per processor.
        only: Number of a single case to report in detail, or None.
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
        """Control period [s]."""
        return 1.0 / self.rate

    @property
    def reaction(self) -> float:
        """Mean age of the applied torque: half a tick plus the delay [s]."""
        return (self.delay + 0.5) * self.period

    @property
    def workers(self) -> int:
        """Number of parallel cases."""
        return self.jobs or os.cpu_count() or 1
