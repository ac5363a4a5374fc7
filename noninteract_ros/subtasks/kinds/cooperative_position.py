# SPDX-License-Identifier: Apache-2.0
"""Where the team is: the weighted mean of the tool points, first row of (34)."""

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
        "Axes of the world; by default those that all robots share", (), choices=AXES
    )
    weights: tuple[float, ...] = key(WEIGHTS_DOC, (), minimum=0.0)

    def build(self, name: str, team: Team, others: Mapping[str, Subtask] = NO_SUBTASKS) -> Subtask:
        """The subtask for a team.

        Raises:
            ScenarioError: Weights do not fit the team, or the axes do not.
        """
        weights = mean_weights(name, self.weights, team)
        axes = chosen_axes(name, self.axes, team)
        subtask = MixedPosition(name, (name,), axes, weights[None, :])
        subtask.mixing = MeanMixing(axes, weights, None)
        return subtask
