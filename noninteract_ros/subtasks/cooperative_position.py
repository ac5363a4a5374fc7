# SPDX-License-Identifier: Apache-2.0
"""Where the team is: the weighted mean of the tool points, first row of (34)."""

from dataclasses import dataclass

import numpy as np

from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import key
from noninteract_ros.subtasks.mixed_position import MixedPosition, chosen_axes
from noninteract_ros.subtasks.subtask import Subtask
from noninteract_ros.team.robot import AXES
from noninteract_ros.team.team import Team


@dataclass(frozen=True)
class CooperativePosition:
    """Configuration block of the cooperative position subtask."""

    kind: str = key("Kind of subtask", choices=("cooperative_position",))
    axes: tuple[str, ...] = key(
        "Axes of the world; by default those that all robots share", (), choices=AXES
    )
    weights: tuple[float, ...] = key(
        "Weight of each robot, normalised to sum 1; by default equal", (), minimum=0.0
    )

    def build(self, name: str, team: Team) -> Subtask:
        """The subtask for a team.

        Raises:
            ScenarioError: Weights do not fit the team, or the axes do not.
        """
        count = len(team.robots)
        weights = np.array(self.weights or (1.0,) * count)
        if weights.shape != (count,) or weights.sum() <= 0.0:
            allowed = f"{count} numbers, one per robot {list(team.names)}, with a positive sum"
            raise ScenarioError(f"{name}.weights", list(self.weights), allowed)
        mean = (weights / weights.sum())[None, :]
        return MixedPosition(name, (name,), chosen_axes(name, self.axes, team), mean)
