# SPDX-License-Identifier: Apache-2.0
"""The kinds of subtask that a scenario can name."""

from typing import Protocol

from noninteract_ros.subtasks.cooperative_position import CooperativePosition
from noninteract_ros.subtasks.relative_position import RelativePosition
from noninteract_ros.subtasks.subtask import Subtask
from noninteract_ros.team.team import Team


class SubtaskBlock(Protocol):
    """Configuration of one subtask: a dataclass of `schema.key` fields that builds it."""

    def build(self, name: str, team: Team) -> Subtask:
        """The subtask for a team."""


SUBTASK_KINDS: dict[str, type[SubtaskBlock]] = {
    "cooperative_position": CooperativePosition,
    "relative_position": RelativePosition,
}
