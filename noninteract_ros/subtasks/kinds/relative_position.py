# SPDX-License-Identifier: Apache-2.0
"""Relative positions of pairs of robots: differences of tool points, second row of (34)."""

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
from noninteract_ros.subtasks.kinds.mixed_position import MixedPosition, chosen_axes
from noninteract_ros.subtasks.kinds.relative_components import RelativePoints
from noninteract_ros.subtasks.mixing import EdgeMixing
from noninteract_ros.subtasks.subtask import Subtask
from noninteract_ros.team.robot import AXES
from noninteract_ros.team.team import Team


@dataclass(frozen=True)
class RelativePosition:
    """Configuration block of the relative position subtask."""

    kind: str = key("Kind of subtask", choices=("relative_position",))
    edges: tuple[str, ...] = key(EDGES_DOC, ())
    frame: str = key(FRAME_DOC, WORLD)
    axes: tuple[str, ...] = key(
        "Axes of the frame; by default the axes common to all robots", (), choices=AXES
    )

    def build(self, name: str, team: Team, others: Mapping[str, Subtask] = NO_SUBTASKS) -> Subtask:
        """Return the subtask for a team, given the subtasks that are listed before it.

        Raises:
            ScenarioError: The edges are not pairs of different robots of the team, or the frame is
                no subtask with an orientation.
        """
        pairs = edge_pairs(name, self.edges, team)
        elements, weights = edge_names(pairs), edge_weights(pairs, team)
        axes = chosen_axes(name, self.axes, team)
        frame = frame_named(name, self.frame, others)
        subtask: Subtask = MixedPosition(name, elements, axes, weights)
        if frame is not None:
            subtask = ComposedSubtask(name, elements, axes, RelativePoints(weights, frame), None)
        subtask.mixing = EdgeMixing(axes, tuple(edge_indices(pairs, team)), False, None, frame)
        return subtask
