# SPDX-License-Identifier: Apache-2.0
"""Relative positions and orientations of pairs of robots, in the world or in a rotating frame.

With the frame's rotation R_c, its angular velocity omega_c = J_c v, and d = p_a - p_b,
E = R_a R_b' of a pair in the world, the pair has in the frame

    position R_c' d        with velocity R_c' (d' + d x omega_c)
    rotation R_c' E R_c    with angular velocity R_c' (omega_E - (1 - E) omega_c),
                           omega_E = omega_a - E omega_b

Both are invariant under rotations of the whole team.
"""

from collections.abc import Sequence

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.components import Component, ComponentState, MixedPoints
from noninteract_ros.team.team import TeamState


class RelativePoints:
    """Differences of tool points, along the axes of a rotating frame.

    Args:
        weights: +1 and -1 for the robots of each pair, shape (pairs, N).
        frame: Rotation of the frame.
    """

    def __init__(self, weights: Array, frame: Component) -> None:
        self._points, self._frame = MixedPoints(weights), frame

    def evaluate(self, state: TeamState) -> ComponentState:
        """Return differences, shape (pairs, 3), and Jacobians, shape (pairs, 3, n)."""
        d, c = self._points.evaluate(state), self._frame.evaluate(state)
        cross = so3.hat(d.value)
        inner = d.J + cross @ c.J[0]
        inner_rate = d.J_rate + so3.hat(d.J @ state.v) @ c.J[0] + cross @ c.J_rate[0]
        J, J_rate = _in_frame(c, state.v, inner, inner_rate)
        return ComponentState(d.value @ c.value[0], J, J_rate)


class RelativeRotations:
    """Rotations from the second robot of each pair to the first.

    Args:
        pairs: Indices of the two robots of each pair in the team.
        offsets: Tool offsets as returned by `tool_offsets`.
        frame: Rotation of the reference frame; None for the world.
    """

    def __init__(
        self, pairs: Sequence[tuple[int, int]], offsets: Array | None, frame: Component | None
    ) -> None:
        self._first, self._second = np.array(pairs).T
        self._offsets, self._frame = offsets, frame

    def evaluate(self, state: TeamState) -> ComponentState:
        """Return rotations, shape (pairs, 3, 3), and Jacobians, shape (pairs, 3, n)."""
        tools = state.tool_rotations
        if self._offsets is not None:
            tools = tools @ self._offsets
        E = tools[self._first] @ np.swapaxes(tools[self._second], 1, 2)
        angular, angular_rate = state.tool_jacobians[:, 3:], state.tool_jacobian_rates[:, 3:]
        second = angular[self._second]
        J = angular[self._first] - E @ second
        E_rate = so3.hat(J @ state.v) @ E
        J_rate = angular_rate[self._first] - E_rate @ second - E @ angular_rate[self._second]
        if self._frame is None:
            return ComponentState(E, J, J_rate)
        c = self._frame.evaluate(state)
        R_c, rest = c.value[0], np.eye(3) - E
        J, J_rate = _in_frame(
            c, state.v, J - rest @ c.J[0], J_rate + E_rate @ c.J[0] - rest @ c.J_rate[0]
        )
        return ComponentState(R_c.T @ E @ R_c, J, J_rate)


def _in_frame(frame: ComponentState, v: Array, J: Array, J_rate: Array) -> tuple[Array, Array]:
    """Return R_c' J and its time derivative, for Jacobians of shape (pairs, 3, n)."""
    R = frame.value[0].T
    omega_hat = so3.hat(frame.J[0] @ v)
    return R @ J, R @ (J_rate - omega_hat @ J)
