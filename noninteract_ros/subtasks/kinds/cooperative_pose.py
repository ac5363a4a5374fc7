# SPDX-License-Identifier: Apache-2.0
"""Cooperative pose of the team: mean tool point and mean tool orientation."""

from collections.abc import Mapping
from dataclasses import dataclass

from noninteract_ros.schema import key
from noninteract_ros.subtasks.components import MixedPoints
from noninteract_ros.subtasks.kinds.composed_subtask import ComposedSubtask
from noninteract_ros.subtasks.kinds.edges import NO_SUBTASKS
from noninteract_ros.subtasks.kinds.mean_weights import ALIGNMENT_DOC, WEIGHTS_DOC, mean_weights
from noninteract_ros.subtasks.kinds.mixed_position import chosen_axes
from noninteract_ros.subtasks.mixing import MeanMixing
from noninteract_ros.subtasks.subtask import Subtask
from noninteract_ros.subtasks.team_rotation import ALIGNMENTS, team_rotation
from noninteract_ros.team.robot import AXES
from noninteract_ros.team.team import Team


@dataclass(frozen=True)
class CooperativePose:
    """Configuration block of the cooperative pose subtask."""

    kind: str = key("Kind of subtask", choices=("cooperative_pose",))
    axes: tuple[str, ...] = key(
        "Axes of the world; by default the axes common to all robots", (), choices=AXES
    )
    weights: tuple[float, ...] = key(WEIGHTS_DOC, (), minimum=0.0)
    alignment: str = key(ALIGNMENT_DOC, "tools", choices=ALIGNMENTS)

    def build(self, name: str, team: Team, others: Mapping[str, Subtask] = NO_SUBTASKS) -> Subtask:
        """Return the subtask for a team.

        Raises:
            ScenarioError: Weights or axes do not fit the team, or the tool orientations are too
                far apart.
        """
        weights = mean_weights(name, self.weights, team)
        rotation = team_rotation(name, team, weights, self.alignment)
        axes = chosen_axes(name, self.axes, team)
        subtask = ComposedSubtask(name, (name,), axes, MixedPoints(weights[None]), rotation)
        subtask.frame, subtask.mixing = rotation, MeanMixing(axes, weights, rotation)
        return subtask


@dataclass(frozen=True)
class CooperativeOrientation:
    """Configuration block of the cooperative orientation subtask."""

    kind: str = key("Kind of subtask", choices=("cooperative_orientation",))
    weights: tuple[float, ...] = key(WEIGHTS_DOC, (), minimum=0.0)
    alignment: str = key(ALIGNMENT_DOC, "tools", choices=ALIGNMENTS)

    def build(self, name: str, team: Team, others: Mapping[str, Subtask] = NO_SUBTASKS) -> Subtask:
        """Return the subtask for a team.

        Raises:
            ScenarioError: Weights do not fit the team, or tool orientations are too far apart.
        """
        weights = mean_weights(name, self.weights, team)
        rotation = team_rotation(name, team, weights, self.alignment)
        subtask = ComposedSubtask(name, (name,), (), None, rotation)
        subtask.frame, subtask.mixing = rotation, MeanMixing((), weights, rotation)
        return subtask
