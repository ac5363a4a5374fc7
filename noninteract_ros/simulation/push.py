# SPDX-License-Identifier: Apache-2.0
"""A person or an object pushing a robot at its tool point."""

from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import key
from noninteract_ros.team.team import Team

RESOLUTION = 1e-9  # [s] what lies less apart is the same instant


@dataclass(frozen=True)
class ScheduledPush:
    """Configuration block of a push that the scenario itself gives."""

    robot: str = key("Robot that is pushed")
    start: float = key("When it begins [s]", minimum=0.0)
    duration: float = key("How long it lasts [s]", positive=True)
    force: tuple[float, ...] = key("Force on the tool point, world axes x, y, z [N]")

    def wrench(self, now: float) -> Array:
        """Wrench on the tool at a time, shape (6,) [N, N m]."""
        acts = -RESOLUTION < now - self.start < self.duration - RESOLUTION
        return np.array([*self.force, 0.0, 0.0, 0.0]) if acts else np.zeros(6)

    def check(self, name: str, team: Team) -> None:
        """Refuses what does not fit the team.

        Raises:
            ScenarioError: The robot is unknown or the force has not three components.
        """
        if self.robot not in team.names:
            raise ScenarioError(f"{name}.robot", repr(self.robot), " | ".join(team.names))
        if len(self.force) != 3:
            raise ScenarioError(f"{name}.force", list(self.force), "3 numbers")


@dataclass(slots=True)
class LivePush:
    """The newest push that came from outside; it lapses when it is not repeated.

    Attributes:
        wrench: Force and torque on the tool, shape (6,) [N, N m].
        in_tool_axes: Whether it is given in tool axes instead of world axes.
        until: Time at which it lapses [s].
    """

    wrench: Array
    in_tool_axes: bool
    until: float
