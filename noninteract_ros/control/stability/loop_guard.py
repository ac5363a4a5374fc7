# SPDX-License-Identifier: Apache-2.0
"""Guard against laws and gains whose sampled loops would diverge."""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.decoupling import task_dynamics
from noninteract_ros.control.law.impedance import Impedance
from noninteract_ros.control.stability.sampled_loops import Loop, closed_loops
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team


class LoopGuard:
    """Check of a law and its gains by their sampled loops, linearised at rest.

    Args:
        team: The robots, with data of their own if another thread evaluates the controller's.
        stack: Subtasks of the team.
        rate: Control rate [Hz].
    """

    def __init__(self, team: Team, stack: SubtaskStack, rate: float) -> None:
        self._team, self._stack, self._rate = team, stack, rate

    def rejection(
        self, q: Array, wanted: tuple[str, Impedance], in_force: tuple[str, Impedance]
    ) -> str:
        """Return the reason to reject a change, with a remedy; empty if it is accepted.

        A loop that diverges less than the current ones is accepted, so that gains which are far
        too high can be reduced step by step.

        Args:
            q: Configuration, shape (nq,).
            wanted: Requested law and gains.
            in_force: Current law and gains.
        """
        try:
            worst = max(self._loops(q, *wanted), key=_growth)
            if worst.stable or worst.growth <= max(map(_growth, self._loops(q, *in_force))):
                return ""
        except np.linalg.LinAlgError:  # At a singularity the law is faded out.
            return ""
        return f"law {wanted[0]}, {worst.name}: {worst.divergence()}"

    def divergence(self, q: Array, law: str, impedance: Impedance) -> str:
        """Return why the loop diverges with a law and its gains at q, shape (nq,), or ""."""
        try:
            worst = max(self._loops(q, law, impedance), key=_growth)
        except np.linalg.LinAlgError:  # At a singularity the law is faded out.
            return ""
        return "" if worst.stable else f"law {law}, {worst.name}: {worst.divergence()}"

    def _loops(self, q: Array, law: str, impedance: Impedance) -> list[Loop]:
        state = self._team.state(q, np.zeros(self._team.n))
        task = self._stack.evaluate(state)
        dynamics = task_dynamics(state, task, self._stack.slices, impedance.inertias)
        return closed_loops(law, dynamics, impedance, self._stack.names, self._rate)


def _growth(loop: Loop) -> float:
    return loop.growth
