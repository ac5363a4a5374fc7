# SPDX-License-Identifier: Apache-2.0
"""Relative poses of pairs of robots: the grasp, or the formation."""

from collections.abc import Mapping
from dataclasses import dataclass

from noninteract_ros.schema import key
from noninteract_ros.subtasks.components import Component, MixedPoints
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
from noninteract_ros.subtasks.kinds.relative_components import RelativePoints, RelativeRotations
from noninteract_ros.subtasks.mixing import EdgeMixing
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
        "Axes of the frame; by default the axes common to all robots", (), choices=AXES
    )
    alignment: str = key(ALIGNMENT_DOC, "tools", choices=ALIGNMENTS)

    def build(self, name: str, team: Team, others: Mapping[str, Subtask] = NO_SUBTASKS) -> Subtask:
        """Return the subtask for a team, given the subtasks that are listed before it.

        Raises:
            ScenarioError: The edges are not pairs of different robots of the team, or the frame is
                no subtask with an orientation.
        """
        pairs = edge_pairs(name, self.edges, team)
        indices = edge_indices(pairs, team)
        frame = frame_named(name, self.frame, others)
        weights = edge_weights(pairs, team)
        points: Component = (
            MixedPoints(weights) if frame is None else RelativePoints(weights, frame)
        )
        offsets = tool_offsets(team, self.alignment)
        rotations = RelativeRotations(indices, offsets, frame)
        axes = chosen_axes(name, self.axes, team)
        subtask = ComposedSubtask(name, edge_names(pairs), axes, points, rotations)
        subtask.mixing = EdgeMixing(axes, tuple(indices), True, offsets, frame)
        return subtask


@dataclass(frozen=True)
class RelativeOrientation:
    """Configuration block of the relative orientation subtask."""

    kind: str = key("Kind of subtask", choices=("relative_orientation",))
    edges: tuple[str, ...] = key(EDGES_DOC, ())
    frame: str = key(FRAME_DOC, WORLD)
    alignment: str = key(ALIGNMENT_DOC, "tools", choices=ALIGNMENTS)

    def build(self, name: str, team: Team, others: Mapping[str, Subtask] = NO_SUBTASKS) -> Subtask:
        """Return the subtask for a team; see `RelativePose.build` for errors."""
        pairs = edge_pairs(name, self.edges, team)
        frame = frame_named(name, self.frame, others)
        offsets = tool_offsets(team, self.alignment)
        indices = edge_indices(pairs, team)
        rotations = RelativeRotations(indices, offsets, frame)
        subtask = ComposedSubtask(name, edge_names(pairs), (), None, rotations)
        subtask.mixing = EdgeMixing((), tuple(indices), True, offsets, frame)
        return subtask
