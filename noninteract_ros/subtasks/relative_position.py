# SPDX-License-Identifier: Apache-2.0
"""How the robots stand to each other: differences of tool points, second row of (34)."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import key
from noninteract_ros.subtasks.mixed_position import MixedPosition, chosen_axes
from noninteract_ros.subtasks.subtask import Subtask
from noninteract_ros.team.robot import AXES
from noninteract_ros.team.team import Team


@dataclass(frozen=True)
class RelativePosition:
    """Configuration block of the relative position subtask."""

    kind: str = key("Kind of subtask", choices=("relative_position",))
    edges: tuple[str, ...] = key(
        "Pairs of robots in sequence, each with the value first - second; by default a chain", ()
    )
    frame: str = key("Frame in which the differences are taken", "world", choices=("world",))
    axes: tuple[str, ...] = key(
        "Axes of the frame; by default those that all robots share", (), choices=AXES
    )

    def build(self, name: str, team: Team) -> Subtask:
        """The subtask for a team.

        Raises:
            ScenarioError: The edges do not name pairs of different robots of the team.
        """
        pairs = self._pairs(name, team)
        weights = np.zeros((len(pairs), len(team.robots)))
        for row, (first, second) in zip(weights, pairs, strict=True):
            row[team.index(first)] = 1.0
            row[team.index(second)] = -1.0
        elements = tuple(f"{first}-{second}" for first, second in pairs)
        return MixedPosition(name, elements, chosen_axes(name, self.axes, team), weights)

    def _pairs(self, name: str, team: Team) -> list[tuple[str, str]]:
        if not self.edges:
            return list(pairwise(team.names))
        pairs = list(zip(self.edges[::2], self.edges[1::2], strict=False))
        known = all(robot in team.names for robot in self.edges)
        if len(self.edges) % 2 or not known or any(a == b for a, b in pairs):
            allowed = f"pairs of different robots of {list(team.names)}"
            raise ScenarioError(f"{name}.edges", list(self.edges), allowed)
        return pairs
