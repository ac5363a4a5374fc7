# SPDX-License-Identifier: Apache-2.0
"""Subtasks composed of a position component and a rotation component."""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.components import Component
from noninteract_ros.subtasks.kinds.mixed_position import axis_rows
from noninteract_ros.subtasks.subtask import Subtask, SubtaskState
from noninteract_ros.team.team import TeamState


class ComposedSubtask(Subtask):
    """Subtask whose elements have positions, rotations, or both.

    Args:
        name: Name of the subtask.
        elements: Names of the elements.
        axes: Axes of the positions that are used, in any order.
        position: Component of the positions; None without axes.
        rotation: Component of the rotations; None without rotations.
    """

    def __init__(
        self,
        name: str,
        elements: tuple[str, ...],
        axes: tuple[str, ...],
        position: Component | None,
        rotation: Component | None,
    ) -> None:
        self.name, self.elements, self.axes = name, elements, axes
        self.rotates = rotation is not None
        self._position, self._rotation = position, rotation
        self._rows = axis_rows(axes)

    def evaluate(self, state: TeamState) -> SubtaskState:
        """Return value, Jacobian and Jacobian rate, element by element."""
        components: list[tuple[Array, Array, Array]] = []
        if self._position is not None:
            found, rows = self._position.evaluate(state), self._rows
            components.append((found.value[:, rows], found.J[:, rows], found.J_rate[:, rows]))
        if self._rotation is not None:
            found = self._rotation.evaluate(state)
            components.append((so3.quaternion(found.value), found.J, found.J_rate))
        x, J, J_rate = (np.concatenate(items, axis=1) for items in zip(*components, strict=True))
        n = len(state.v)
        return SubtaskState(x.ravel(), J.reshape(-1, n), J_rate.reshape(-1, n))
