# SPDX-License-Identifier: Apache-2.0
"""Kinds of subtask of a user, outside the package."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from noninteract_ros.schema import key
from noninteract_ros.subtasks.subtask import Subtask, SubtaskState
from noninteract_ros.team.team import Team, TeamState


@dataclass(frozen=True)
class Distance:
    """Configuration block: squared distance of the first two robots, and what they share."""

    kind: str = key("Kind of subtask")
    scale: float = key("Factor", 1.0, positive=True)

    def build(self, name: str, team: Team, others: Mapping[str, Subtask]) -> Subtask:
        return SquaredDistance(name, self.scale)


class SquaredDistance(Subtask):
    """x = scale |p_1 - p_2|^2."""

    def __init__(self, name: str, scale: float) -> None:
        self.name, self.elements, self.axes = name, (name,), ("x",)
        self._scale = scale

    def evaluate(self, state: TeamState) -> SubtaskState:
        p, J, J_rate = (
            item[0] - item[1]
            for item in (
                state.tool_positions,
                state.tool_jacobians[:, :3],
                state.tool_jacobian_rates[:, :3],
            )
        )
        factor = 2.0 * self._scale
        rate = (J @ state.v) @ J + p @ J_rate
        return SubtaskState(
            np.array([self._scale * (p @ p)]), factor * (p @ J)[None], factor * rate[None]
        )


@dataclass(frozen=True)
class Unfinished:
    """A block without the key `kind`."""

    def build(self, name: str, team: Team, others: Mapping[str, Subtask]) -> Subtask:
        raise NotImplementedError


NOT_A_CLASS = 3
