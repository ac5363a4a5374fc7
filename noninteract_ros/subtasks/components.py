# SPDX-License-Identifier: Apache-2.0
"""Components of subtasks: positions or rotations of elements, with their differentials."""

from dataclasses import dataclass
from typing import Protocol

from noninteract_ros.arrays import Array
from noninteract_ros.team.team import TeamState


@dataclass(frozen=True, slots=True)
class ComponentState:
    """Positions or rotations of all elements, with their differentials.

    Attributes:
        value: Positions, shape (elements, k), or rotation matrices, shape (elements, 3, 3).
        J: Jacobians, of the angular velocity for rotations, shape (elements, k, n).
        J_rate: Time derivatives of the Jacobians, shape (elements, k, n).
    """

    value: Array
    J: Array
    J_rate: Array


class Component(Protocol):
    """Positions along x, y, z, or rotations, as a function of the team's state."""

    def evaluate(self, state: TeamState) -> ComponentState:
        """Return values and differentials at a state of the team."""


class MixedPoints:
    """Sums of the tool points with constant weights, in the world.

    Args:
        weights: Weight of each robot in each element, shape (elements, N).
    """

    def __init__(self, weights: Array) -> None:
        self._weights = weights

    def evaluate(self, state: TeamState) -> ComponentState:
        """Return values and differentials along x, y, z."""
        count, _, n = state.tool_jacobians.shape
        linear = state.tool_jacobians[:, :3].reshape(count, -1)
        linear_rate = state.tool_jacobian_rates[:, :3].reshape(count, -1)
        return ComponentState(
            self._weights @ state.tool_positions,
            (self._weights @ linear).reshape(-1, 3, n),
            (self._weights @ linear_rate).reshape(-1, 3, n),
        )
