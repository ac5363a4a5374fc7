# SPDX-License-Identifier: Apache-2.0
"""Orientation of the team: the mean of the tool orientations on SO(3).

The mean R_c is the rotation with the least weighted sum of squared angles to the tools, so that
the rotation vectors phi_k = log(R_k R_c') satisfy sum w_k phi_k = 0. With A_k = A(phi_k)^-1 of
`so3`, dphi_k/dt = A_k omega_k - A_k' omega_c, hence exactly

    B omega_c = sum over k of w_k A_k omega_k,    B = sum over k of w_k A_k'

The mean is unique while the angle to every tool is less than a quarter turn. For two tools of
equal weight it is half-way between them, in closed form. When these tools become opposite, the
mean jumps with the shortest rotation between them, but its differentials stay bounded.
"""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import ScenarioError
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.components import ComponentState
from noninteract_ros.team.team import Team, TeamState

ALIGNMENTS = ("tools", "start")
MAX_SPREAD = np.radians(80.0)  # initial angle between a tool and the mean
_ROUNDING = 1e-14
_ITERATIONS = 20


def tool_offsets(team: Team, alignment: str) -> Array | None:
    """Return the constant rotation applied to each tool orientation, shape (N, 3, 3).

    Args:
        team: The robots.
        alignment: `tools` uses the orientations themselves (None); `start` measures them from the
            initial orientations.
    """
    if alignment == "tools":
        return None
    start = team.state(team.q0, np.zeros(team.n)).tool_rotations
    return np.swapaxes(start, 1, 2).copy()


class TeamRotation:
    """Mean orientation of the tools, and reference frame of relative subtasks.

    Args:
        weights: Weight of each robot, with sum 1, shape (N,).
        offsets: Tool offsets as returned by `tool_offsets`.

    Attributes:
        weights: As given.
        offsets: As given.
    """

    def __init__(self, weights: Array, offsets: Array | None) -> None:
        self.weights, self.offsets = weights, offsets
        self._halfway = weights.shape == (2,) and weights[0] == weights[1]
        self._last: tuple[TeamState, ComponentState] | None = None

    def evaluate(self, state: TeamState) -> ComponentState:
        """Return R_c, shape (1, 3, 3), and the differentials of its angular velocity.

        The result for the last state is cached, since all subtasks in this frame evaluate it.
        """
        if self._last is None or self._last[0] is not state:
            found = self._midpoint(state) if self._halfway else self._mean(state)
            self._last = (state, found)
        return self._last[1]

    def spread(self, state: TeamState) -> float:
        """Return the largest angle between a tool and the mean [rad]."""
        R_c = self.evaluate(state).value[0]
        apart = so3.log(so3.quaternion(self._tools(state) @ R_c.T))
        return float(np.linalg.norm(apart[self.weights > 0.0], axis=1).max())

    def _tools(self, state: TeamState) -> Array:
        if self.offsets is None:
            return state.tool_rotations
        return state.tool_rotations @ self.offsets

    def _midpoint(self, state: TeamState) -> ComponentState:
        """Evaluate the midpoint: R_c = H R_1 with H H = R_2 R_1'.

        Then (1 + H) omega_c = omega_2 + H omega_1, and by Cayley's map (1 + H)^-1 = (1 - [c]) / 2
        with c = axis tan(angle of H / 2).
        """
        R_1, R_2 = self._tools(state)
        whole = so3.quaternion(R_2 @ R_1.T)
        half = so3.normalized(whole + np.array([0.0, 0.0, 0.0, 1.0]))
        c = half[:3] / half[3]
        H = so3.matrix(half)
        mean, apart = _mean_and_difference(state.tool_jacobians[:, 3:])
        mean_rate, apart_rate = _mean_and_difference(state.tool_jacobian_rates[:, 3:])
        cross = 0.5 * so3.hat(c)
        J = mean - cross @ apart
        omega_H = J @ state.v - H @ (state.tool_jacobians[0, 3:] @ state.v)
        c_rate = 0.5 * (omega_H + so3.hat(omega_H) @ c + c * (omega_H @ c))
        J_rate = mean_rate - cross @ apart_rate - 0.5 * so3.hat(c_rate) @ apart
        return ComponentState((H @ R_1)[None], J[None], J_rate[None])

    def _mean(self, state: TeamState) -> ComponentState:
        """Evaluate the mean by Newton's method, its differentials by the implicit equation."""
        q_c, phi = self.solve(so3.quaternion(self._tools(state)))
        w = self.weights[:, None, None]
        A = so3.inverse_jacobian(phi)
        B_inverse = np.linalg.inv((w * A).sum(axis=0).T)
        angular, angular_rate = state.tool_jacobians[:, 3:], state.tool_jacobian_rates[:, 3:]
        J = B_inverse @ (w * (A @ angular)).sum(axis=0)
        omega = angular @ state.v
        phi_rate = (A @ omega[..., None])[..., 0] - np.swapaxes(A, 1, 2) @ (J @ state.v)
        A_rate = so3.inverse_jacobian_rate(phi, phi_rate)
        B_rate = (w * A_rate).sum(axis=0).T
        moved = (w * (A_rate @ angular + A @ angular_rate)).sum(axis=0)
        return ComponentState(
            so3.matrix(q_c)[None], J[None], (B_inverse @ (moved - B_rate @ J))[None]
        )

    def solve(self, tools: Array) -> tuple[Array, Array]:
        """Return the mean's quaternion (4,) and the rotation vectors to the tools (N, 3)."""
        # Mean of the lines spanned by the quaternions, independent of their signs.
        q_c = np.linalg.eigh((self.weights[:, None] * tools).T @ tools)[1][:, -1]
        for _ in range(_ITERATIONS):
            phi = so3.log(so3.product(tools, so3.inverse(q_c)))
            rest = self.weights @ phi
            if np.abs(rest).max() < _ROUNDING:
                break
            B = (self.weights[:, None, None] * so3.inverse_jacobian(phi)).sum(axis=0).T
            q_c = so3.normalized(so3.product(so3.exp(np.linalg.solve(B, rest)), q_c))
        return q_c, phi


def _mean_and_difference(pair: Array) -> tuple[Array, Array]:
    return 0.5 * (pair[0] + pair[1]), pair[1] - pair[0]


def team_rotation(name: str, team: Team, weights: Array, alignment: str) -> TeamRotation:
    """Return the mean orientation of a team.

    Raises:
        ScenarioError: The initial tool orientations are too far apart to have a mean.
    """
    found = TeamRotation(weights, tool_offsets(team, alignment))
    spread = found.spread(team.state(team.q0, np.zeros(team.n)))
    if not spread < MAX_SPREAD:
        text = f"{alignment!r}, with tools {np.degrees(spread):.0f} degrees from their mean"
        allowed = f"at most {np.degrees(MAX_SPREAD):.0f} degrees; 'start' brings them together"
        raise ScenarioError(f"{name}.alignment", text, allowed)
    return found
