# SPDX-License-Identifier: Apache-2.0
"""Settings of singularities and of the limits of joints."""

from dataclasses import dataclass

from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import key


@dataclass(frozen=True)
class SafetySettings:
    """The block `safety` of a scenario; the limits themselves are keys of the robots."""

    singularity_begin: float = key(
        "Regularity, relative to the team's best, below which the law begins to fade out",
        0.3,
        positive=True,
        maximum=1.0,
    )
    singularity_end: float = key(
        "Relative regularity below which the team only recovers", 0.1, positive=True, maximum=1.0
    )
    singularity_escape: bool = key(
        "Whether a team that was put into a singularity moves out by itself; else it stands", True
    )
    recovery_stiffness: float = key(
        "Pull back to the last regular configuration [1/s^2]", 100.0, minimum=0.0
    )
    recovery_damping: float = key("Damping of the recovery [1/s]", 20.0, positive=True)
    position_margin: float = key(
        "Distance to a joint limit at which it begins to repel [m or rad]", 0.1, positive=True
    )
    position_rate: float = key(
        "Natural frequency of a joint against its limit, critically damped [rad/s]",
        100.0,
        minimum=0.0,
    )
    velocity_rate: float = key(
        "Rate at which a joint loses what it is too fast [1/s]", 200.0, minimum=0.0
    )
    torque_rate: float = key(
        "Largest change of a joint torque per second [N/s or N m/s]; 0: none", 0.0, minimum=0.0
    )

    def check(self) -> None:
        """Refuses thresholds in the wrong order.

        Raises:
            ScenarioError: `singularity_end` is not below `singularity_begin`.
        """
        if self.singularity_end >= self.singularity_begin:
            allowed = f"< singularity_begin ({self.singularity_begin:g})"
            raise ScenarioError("safety.singularity_end", self.singularity_end, allowed)
