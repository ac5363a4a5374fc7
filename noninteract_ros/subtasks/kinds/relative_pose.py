# SPDX-License-Identifier: Apache-2.0
"""How the robots stand and point to each other: the grasp, or the formation."""

from collections.abc import Mapping
from dataclasses import dataclass

from noninteract_ros.schema import key
from noninteract_ros.subtasks.kinds.composed_subtask import ComposedSubtask
from noninteract_ros.subtasks.kinds.edges import (
    EDGES_DOC,
    FRAME_DOC,
    NO_SUBTASKS,
    WORLD,
    edge_indices,
    edge_names,
    edge_pairs,
    edge_weights,
    frame_named,
)
from noninteract_ros.subtasks.kinds.mean_weights import ALIGNMENT_DOC
from noninteract_ros.subtasks.kinds.mixed_position import chosen_axes
from noninteract_ros.subtasks.kinds.relative_parts import RelativePoints, RelativeRotations
from noninteract_ros.subtasks.mixing import EdgeMixing
from noninteract_ros.subtasks.parts import MixedPoints, Part
from noninteract_ros.subtasks.subtask import Subtask
from noninteract_ros.subtasks.team_rotation import ALIGNMENTS, tool_offsets
from noninteract_ros.team.robot import AXES
from noninteract_ros.team.team import Team


@dataclass(frozen=True)
class RelativePose:
    """Configuration block of the relative pose subtask."""

    kind: str = key("Kind of subtask", choices=("relative_pose",))
    edges: tuple[str, ...] = key(EDGES_DOC, ())
    frame: str = key(FRAME_DOC, WORLD)
    axes: tuple[str, ...] = key(
        "Axes of the frame; by default those that all robots share", (), choices=AXES
    )
    alignment: str = key(ALIGNMENT_DOC, "tools", choices=ALIGNMENTS)

    def build(self, name: str, team: Team, others: Mapping[str, Subtask] = NO_SUBTASKS) -> Subtask:
        """The subtask for a team, with the subtasks that are listed before it.

        Raises:
            ScenarioError: The edges do not name pairs of different robots of the team, or the
                frame is no subtask with an orientation.
        """
        pairs = edge_pairs(name, self.edges, team)
        places = edge_indices(pairs, team)
        frame = frame_named(name, self.frame, others)
        weights = edge_weights(pairs, team)
        points: Part = MixedPoints(weights) if frame is None else RelativePoints(weights, frame)
        offsets = tool_offsets(team, self.alignment)
        rotations = RelativeRotations(places, offsets, frame)
        axes = chosen_axes(name, self.axes, team)
        subtask = ComposedSubtask(name, edge_names(pairs), axes, points, rotations)
        subtask.mixing = EdgeMixing(axes, tuple(places), True, offsets, frame)
        return subtask


@dataclass(frozen=True)
class RelativeOrientation:
    """Configuration block of the relative orientation subtask."""

    kind: str = key("Kind of subtask", choices=("relative_orientation",))
    edges: tuple[str, ...] = key(EDGES_DOC, ())
    frame: str = key(FRAME_DOC, WORLD)
    alignment: str = key(ALIGNMENT_DOC, "tools", choices=ALIGNMENTS)

    def build(self, name: str, team: Team, others: Mapping[str, Subtask] = NO_SUBTASKS) -> Subtask:
        """The subtask for a team; raises as `RelativePose.build`."""
        pairs = edge_pairs(name, self.edges, team)
        frame = frame_named(name, self.frame, others)
        offsets = tool_offsets(team, self.alignment)
        places = edge_indices(pairs, team)
        rotations = RelativeRotations(places, offsets, frame)
        subtask = ComposedSubtask(name, edge_names(pairs), (), None, rotations)
        subtask.mixing = EdgeMixing((), tuple(places), True, offsets, frame)
        return subtask
