# SPDX-License-Identifier: Apache-2.0
"""Subtasks put together from a part for the positions and a part for the rotations."""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.kinds.mixed_position import axis_rows
from noninteract_ros.subtasks.parts import Part
from noninteract_ros.subtasks.subtask import Subtask, SubtaskState
from noninteract_ros.team.team import TeamState


class ComposedSubtask(Subtask):
    """Elements with positions, with rotations, or with both.

    Args:
        name: Name of the subtask.
        elements: Names of the elements.
        axes: Axes that are kept of the positions, in any order.
        position: Gives the positions; None where there are no axes.
        rotation: Gives the rotations; None where there are none.
    """

    def __init__(
        self,
        name: str,
        elements: tuple[str, ...],
        axes: tuple[str, ...],
        position: Part | None,
        rotation: Part | None,
    ) -> None:
        self.name, self.elements, self.axes = name, elements, axes
        self.rotates = rotation is not None
        self._position, self._rotation = position, rotation
        self._rows = axis_rows(axes)

    def evaluate(self, state: TeamState) -> SubtaskState:
        """Value, Jacobian and Jacobian rate, element after element."""
        parts: list[tuple[Array, Array, Array]] = []
        if self._position is not None:
            found, rows = self._position.evaluate(state), self._rows
            parts.append((found.value[:, rows], found.J[:, rows], found.J_rate[:, rows]))
        if self._rotation is not None:
            found = self._rotation.evaluate(state)
            parts.append((so3.quaternion(found.value), found.J, found.J_rate))
        x, J, J_rate = (np.concatenate(items, axis=1) for items in zip(*parts, strict=True))
        n = len(state.v)
        return SubtaskState(x.ravel(), J.reshape(-1, n), J_rate.reshape(-1, n))
