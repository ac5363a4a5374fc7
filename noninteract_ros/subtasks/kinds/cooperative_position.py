# SPDX-License-Identifier: Apache-2.0
"""Cooperative position of the team: weighted mean of the tool points, first row of (34)."""

from collections.abc import Mapping
from dataclasses import dataclass

from noninteract_ros.schema import key
from noninteract_ros.subtasks.kinds.edges import NO_SUBTASKS
from noninteract_ros.subtasks.kinds.mean_weights import WEIGHTS_DOC, mean_weights
from noninteract_ros.subtasks.kinds.mixed_position import MixedPosition, chosen_axes
from noninteract_ros.subtasks.mixing import MeanMixing
from noninteract_ros.subtasks.subtask import Subtask
from noninteract_ros.team.robot import AXES
from noninteract_ros.team.team import Team


@dataclass(frozen=True)
class CooperativePosition:
    """Configuration block of the cooperative position subtask."""

    kind: str = key("Kind of subtask", choices=("cooperative_position",))
    axes: tuple[str, ...] = key(
        "Axes of the world; by default the axes common to all robots", (), choices=AXES
    )
    weights: tuple[float, ...] = key(WEIGHTS_DOC, (), minimum=0.0)

    def build(self, name: str, team: Team, others: Mapping[str, Subtask] = NO_SUBTASKS) -> Subtask:
        """Return the subtask for a team.

        Raises:
            ScenarioError: Weights or axes do not fit the team.
        """
        weights = mean_weights(name, self.weights, team)
        axes = chosen_axes(name, self.axes, team)
        subtask = MixedPosition(name, (name,), axes, weights[None, :])
        subtask.mixing = MeanMixing(axes, weights, None)
        return subtask
