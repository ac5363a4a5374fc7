# SPDX-License-Identifier: Apache-2.0
"""What a subtask is: definition 1, equations (4) to (6)."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

from noninteract_ros.arrays import Array
from noninteract_ros.team.team import TeamState


@dataclass(frozen=True, slots=True)
class SubtaskState:
    """Value and differential of one subtask, or of several stacked ones.

    Attributes:
        x: Value phi(q), shape (p,).
        J: Jacobian, shape (p, n): dx/dt = J v.
        J_rate: Its time derivative along the motion, shape (p, n).
    """

    x: Array
    J: Array
    J_rate: Array


class Subtask(ABC):
    """A smooth map from the team's configuration to the coordinates of one goal.

    Attributes:
        name: Name in the scenario; prefixes its topics.
        elements: Names of the bodies or edges that its messages list, in order.
        axes: Axes of the world that each element has.
        dim: Number of coordinates p; the vector runs over elements, then axes.
    """

    name: str
    elements: tuple[str, ...]
    axes: tuple[str, ...]

    @property
    def dim(self) -> int:
        """Number of coordinates."""
        return len(self.elements) * len(self.axes)

    @abstractmethod
    def evaluate(self, state: TeamState) -> SubtaskState:
        """Value, Jacobian and Jacobian rate at a state of the team."""
