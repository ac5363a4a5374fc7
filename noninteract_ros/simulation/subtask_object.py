# SPDX-License-Identifier: Apache-2.0
"""Object of the paper's Section V: a mass and a stiffness at subtask level."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import ScenarioError, one_of
from noninteract_ros.memo import Memo
from noninteract_ros.schema import key
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import TeamState

SIGNS = {"physical": -1.0, "paper": 1.0}


@dataclass(frozen=True)
class ObjectSettings:
    """Configuration block of the object held by the team."""

    mass: float = key("Mass m_o moved by the carrying subtask [kg]", 0.0, minimum=0.0)
    stiffness: float = key("Stiffness k_o strained by the grasping subtask [N/m]", 0.0, minimum=0)
    rest: tuple[float, ...] = key("Unstrained value of the grasping subtask [m]", ())
    carried_by: str = key("Subtask that carries the mass", "cooperative")
    grasped_by: str = key("Subtask that strains the stiffness", "relative")
    sign: str = key(
        "physical: inertia and spring oppose the motion; paper: sign as printed in Section V",
        "physical",
        choices=tuple(SIGNS),
    )


class SubtaskObject:
    """tau~_c = s m_o dv_c/dt and tau~_r = s k_o (x_r - rest), applied as tau_e = Gamma tau~_e.

    Args:
        settings: Mass, stiffness, rest value and sign s.
        stack: The team's subtasks.

    Raises:
        ScenarioError: A subtask is unknown or has rotations, or `rest` does not have its size.
    """

    def __init__(self, settings: ObjectSettings, stack: SubtaskStack) -> None:
        for name in ("carried_by", "grasped_by"):
            found = getattr(settings, name)
            if found not in stack.names:
                raise ScenarioError(f"object.{name}", repr(found), one_of(stack.names, found))
            if stack.subtasks[stack.names.index(found)].rotates:
                allowed = "a subtask without rotations"
                raise ScenarioError(f"object.{name}", repr(found), allowed)
        self._stack = stack
        self._terms = Memo(self._compute_terms)
        self._carrying = stack.slices[stack.names.index(settings.carried_by)]
        self._grasping = stack.slices[stack.names.index(settings.grasped_by)]
        self._grasped = stack.value_slices[stack.names.index(settings.grasped_by)]
        dim = self._grasping.stop - self._grasping.start
        if settings.stiffness and len(settings.rest) != dim:
            raise ScenarioError("object.rest", list(settings.rest), f"{dim} numbers")
        sign = SIGNS[settings.sign]
        self._mass, self._stiffness = sign * settings.mass, sign * settings.stiffness
        self._rest = np.array(settings.rest) if settings.stiffness else np.zeros(dim)

    def acceleration(self, state: TeamState, load: Array) -> tuple[Array, Array]:
        """Return the acceleration of the team with the object, and the object's torque.

        Args:
            state: State of the team.
            load: All other torques except Coriolis and gravity torques, shape (n,) [N or N m].

        Returns:
            Acceleration and torque, shape (n,) each.
        """
        terms, b = self._terms_at(state)
        free = load - state.C @ state.v - state.g
        acceleration = terms.inverse @ (free + b)
        return acceleration, terms.A @ acceleration + b

    def torque_terms(self, state: TeamState) -> tuple[Array, Array]:
        """Return A (n, n) and b (n,) of the object's torque A dv/dt + b."""
        terms, b = self._terms_at(state)
        return terms.A, b

    def _terms_at(self, state: TeamState) -> tuple["_Terms", Array]:
        task = self._stack.evaluate(state)
        terms = self._terms(state.M, task.J, task.J_rate)
        strain = self._stiffness * (task.x[self._grasped] - self._rest)
        return terms, terms.A_rate @ state.v + terms.grasped @ strain

    def _compute_terms(self, M: Array, J: Array, J_rate: Array) -> "_Terms":
        S = np.linalg.inv(J)
        carried, grasped = (
            _decoupling_columns(M, S[:, part]) for part in (self._carrying, self._grasping)
        )
        A = self._mass * carried @ J[self._carrying]
        A_rate = self._mass * carried @ J_rate[self._carrying]
        return _Terms(A, A_rate, grasped, np.linalg.inv(M - A))


class _Terms(NamedTuple):
    """Terms of M and J: A and its part with J_rate, Gamma_r, and (M - A)^-1."""

    A: Array
    A_rate: Array
    grasped: Array
    inverse: Array


def _decoupling_columns(M: Array, S_i: Array) -> Array:
    """Return the columns M S_i (S_i' M S_i)^-1 of Gamma of one subtask, shape (n, p_i)."""
    MS_i = M @ S_i
    return np.linalg.solve(S_i.T @ MS_i, MS_i.T).T
