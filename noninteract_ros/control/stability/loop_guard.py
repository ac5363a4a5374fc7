# SPDX-License-Identifier: Apache-2.0
"""Whether law and gains that are asked for would diverge where the team is."""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.decoupling import task_dynamics
from noninteract_ros.control.law.impedance import Impedance
from noninteract_ros.control.stability.sampled_loops import Loop, closed_loops
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team


class LoopGuard:
    """Judges modes by their sampled loops, linearised at rest at a configuration.

    Args:
        team: The robots; its own, as another thread may evaluate the controller's.
        stack: Their subtasks.
        rate: Ticks per second [Hz].
    """

    def __init__(self, team: Team, stack: SubtaskStack, rate: float) -> None:
        self._team, self._stack, self._rate = team, stack, rate

    def rejection(
        self, q: Array, wanted: tuple[str, Impedance], in_force: tuple[str, Impedance]
    ) -> str:
        """Why a change must not be made, and what would cure it; or an empty text.

        A loop that diverges less than those in force is let through, so that gains which are far
        too high can come down step by step.

        Args:
            q: Configuration, shape (nq,).
            wanted: Law and gains that are asked for.
            in_force: Law and gains until now.
        """
        try:
            worst = max(self._loops(q, *wanted), key=_growth)
            if worst.stable or worst.growth <= max(map(_growth, self._loops(q, *in_force))):
                return ""
        except np.linalg.LinAlgError:  # In a singularity the law is not in force anyway.
            return ""
        return f"law {wanted[0]}, {worst.name}: {worst.divergence()}"

    def _loops(self, q: Array, law: str, impedance: Impedance) -> list[Loop]:
        state = self._team.state(q, np.zeros(self._team.n))
        task = self._stack.evaluate(state)
        dynamics = task_dynamics(state, task, self._stack.slices, impedance.inertias)
        return closed_loops(law, dynamics, impedance, self._stack.names, self._rate)


def _growth(loop: Loop) -> float:
    return loop.growth
