# SPDX-License-Identifier: Apache-2.0
"""Forces that subtasks are to press with: fed forward, and regulated where they are measured.

What a subtask presses with is -(S' tau_e)_i, the force that its surroundings answer. The integral
has no storage function of its own and needs none: its force is part of the decoupling, and its
work is paid from the tank like everything else there.
"""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.impedance import Impedance
from noninteract_ros.memo import Memo


class ForceGoals:
    """The integrals of all subtasks.

    Args:
        dim: Number of coordinates.
    """

    def __init__(self, dim: int) -> None:
        self._integral: Array = np.zeros(dim)
        self._has_goal = Memo(_has_goal)

    def reset(self) -> None:
        """Have the integrals start at zero."""
        self._integral = np.zeros_like(self._integral)

    def wanted(self, impedance: Impedance) -> Array | None:
        """Return the force to add now, shape (n,) [N]; None where no subtask has a goal."""
        if not self._has_goal(impedance):
            return None
        return impedance.goal + np.where(impedance.goal_gain > 0.0, self._integral, 0.0)

    def advance(self, impedance: Impedance, pressing: Array, step: float, held: bool) -> None:
        """Integrate what is missing of the goals, within bounds.

        Args:
            impedance: Goals, gains and bounds in force.
            pressing: -(S' tau_e), shape (n,) [N].
            step: Time since the last tick [s].
            held: True where the integrals stand still, as they do while a gate closes.
        """
        gain, bound = impedance.goal_gain, impedance.goal_bound
        change = 0.0 if held else gain * step * (impedance.goal - pressing)
        whole = np.clip(self._integral + change, -bound, bound)
        self._integral = np.where(gain > 0.0, whole, 0.0)


def _has_goal(impedance: Impedance) -> bool:
    return bool(impedance.goal.any() or impedance.goal_gain.any())
