# SPDX-License-Identifier: Apache-2.0
"""Subtasks that combine the tool points with constant weights."""

from noninteract_ros.arrays import Array
from noninteract_ros.errors import ScenarioError
from noninteract_ros.memo import Memo
from noninteract_ros.subtasks.subtask import Subtask, SubtaskState
from noninteract_ros.team.robot import AXES
from noninteract_ros.team.team import Team, TeamState


class MixedPosition(Subtask):
    """x_e = sum over robots k of W[e, k] p_k, along the chosen axes.

    Args:
        name: Name of the subtask.
        elements: Element names, one per row of `weights`.
        axes: Axes of the world, in any order.
        weights: W, shape (elements, N).
    """

    def __init__(
        self, name: str, elements: tuple[str, ...], axes: tuple[str, ...], weights: Array
    ) -> None:
        self.name, self.elements, self.axes = name, elements, axes
        self._weights = weights
        self._rows = axis_rows(axes)
        self._mixed, self._mixed_rate = Memo(self._mix), Memo(self._mix)

    def evaluate(self, state: TeamState) -> SubtaskState:
        """Return value, Jacobian and Jacobian rate, each combined with the constant weights."""
        x = self._weights @ state.tool_positions[:, self._rows]
        J = self._mixed(state.tool_jacobians)
        return SubtaskState(x.ravel(), J, self._mixed_rate(state.tool_jacobian_rates))

    def _mix(self, tools: Array) -> Array:
        count, _, n = tools.shape
        along_axes = tools[:, self._rows].reshape(count, -1)
        return (self._weights @ along_axes).reshape(-1, n)


def axis_rows(axes: tuple[str, ...]) -> slice | list[int]:
    """Return the indices of axes among x, y, z: a slice, which gives views, or a list."""
    rows = [AXES.index(axis) for axis in axes]
    ordered = rows == list(range(rows[0], rows[0] + len(rows))) if rows else False
    return slice(rows[0], rows[-1] + 1) if ordered else rows


def chosen_axes(name: str, axes: tuple[str, ...], team: Team) -> tuple[str, ...]:
    """Return the given axes, or by default the axes along which every robot can move.

    Raises:
        ScenarioError: An axis is repeated, or no axis is common to all robots.
    """
    common = tuple(axis for axis in AXES if all(axis in robot.axes for robot in team.robots))
    chosen = axes or common
    if not chosen or len(set(chosen)) != len(chosen):
        allowed = f"different ones of x, y, z; common to all robots are {list(common)}"
        raise ScenarioError(f"{name}.axes", list(chosen), allowed)
    return chosen
