# SPDX-License-Identifier: Apache-2.0
"""Planar arms of two links with closed-form dynamics, for tests that must not trust Pinocchio."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pinocchio as pin

from noninteract_ros.subtasks.kinds.mixed_position import MixedPosition
from noninteract_ros.subtasks.subtask import SubtaskState
from noninteract_ros.team.robot import Robot
from noninteract_ros.team.team import TeamState

LENGTH = 0.5  # [m] of each link
UNLIKE = ((1.0, 1.0), (5.0, 3.0))  # [kg] the two unlike arms of the derivations


class PlanarArms:
    """Arms in the x-y plane, a point mass at the end of each link.

    It gives the law what a `Team` gives it, by formulas that can be checked on paper.

    Args:
        masses: Mass on each of the two links, by arm [kg].
        gravity: Gravitational acceleration along -y [m/s^2].
    """

    def __init__(
        self, masses: Sequence[tuple[float, float]] = UNLIKE, gravity: float = 0.0
    ) -> None:
        self.masses, self._gravity = tuple(masses), gravity
        self.bases = [np.array([1.2 * i, 0.1 * i, 0.0]) for i in range(len(self.masses))]
        self.n = 2 * len(self.masses)

    def state(self, q: np.ndarray, v: np.ndarray) -> TeamState:
        """M, C, g, tool points, Jacobians and rates at (q, v)."""
        count, n = len(self.masses), self.n
        M, C, g = np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
        positions = np.array(self.bases)
        J, J_rate = np.zeros((count, 6, n)), np.zeros((count, 6, n))
        R = np.zeros((count, 3, 3))
        R[:, 2, 2] = 1.0
        for i, masses in enumerate(self.masses):
            own = slice(2 * i, 2 * i + 2)
            M[own, own], C[own, own], g[own] = self._dynamics(*masses, q[own], v[own])
            a, ab = q[own][0], q[own].sum()
            a_rate, ab_rate = v[own][0], v[own].sum()
            positions[i, :2] += LENGTH * (along(a) + along(ab))
            J[i, :2, own] = LENGTH * np.column_stack([across(a) + across(ab), across(ab)])
            last = -along(ab) * ab_rate
            J_rate[i, :2, own] = LENGTH * np.column_stack([last - along(a) * a_rate, last])
            J[i, 5, own] = 1.0
            R[i, :2, :2] = np.column_stack([along(ab), across(ab)])
        return TeamState(q, v, M, C, g, positions, J, J_rate, R)

    def _dynamics(
        self, m_1: float, m_2: float, q: np.ndarray, v: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Inertia, Coriolis matrix of Christoffel's symbols and gravity torque of one arm."""
        cosine, sine = np.cos(q[1]), np.sin(q[1])
        near, far = m_1 * LENGTH**2, m_2 * LENGTH**2
        mixed = far * (1.0 + cosine)
        M = np.array([[near + 2.0 * mixed, mixed], [mixed, far]])
        C = far * sine * np.array([[-v[1], -v[0] - v[1]], [v[0], 0.0]])
        outer = m_2 * np.cos(q[0] + q[1])
        g = self._gravity * LENGTH * np.array([(m_1 + m_2) * np.cos(q[0]) + outer, outer])
        return M, C, g

    def acceleration(self, state: TeamState, torque: np.ndarray) -> np.ndarray:
        """Equation (3)."""
        return np.linalg.solve(state.M, torque - state.C @ state.v - state.g)

    def random_state(self, rng: np.random.Generator, speed: float = 2.0) -> TeamState:
        """A state with every elbow well bent, hence no singular Jacobian."""
        q, v = rng.uniform(-np.pi, np.pi, self.n), rng.uniform(-speed, speed, self.n)
        q[1::2] = rng.uniform(0.7, 2.4, self.n // 2) * rng.choice([-1.0, 1.0], self.n // 2)
        return self.state(q, v)

    def robots(self) -> list[Robot]:
        """Pinocchio models of the arms, with all bases at the origin."""
        return [arm(f"arm_{i + 1}", *masses) for i, masses in enumerate(self.masses)]


def along(angle: float) -> np.ndarray:
    return np.array([np.cos(angle), np.sin(angle)])


def across(angle: float) -> np.ndarray:
    return np.array([-np.sin(angle), np.cos(angle)])


def arm(name: str, *masses: float, axes: str = "zz", start: Sequence[float] = (0.4, 1.1)) -> Robot:
    """A serial arm of revolute joints about the given axes, each link along its own x."""
    joints = {"x": pin.JointModelRX, "y": pin.JointModelRY, "z": pin.JointModelRZ}
    model, parent, place = pin.Model(), 0, pin.SE3.Identity()
    end = pin.SE3(np.eye(3), np.array([LENGTH, 0.0, 0.0]))
    for k, (axis, mass) in enumerate(zip(axes, masses, strict=True)):
        parent = model.addJoint(parent, joints[axis](), place, f"joint_{k + 1}")
        body = pin.Inertia(mass, np.zeros(3), np.zeros((3, 3)))
        model.appendBodyToJoint(parent, body, end)
        place = end
    model.addFrame(pin.Frame("tool", parent, end, pin.FrameType.OP_FRAME))
    return Robot(name, model, "tool", np.array(start, dtype=float), ("x", "y"), 1.0)


def mixed_subtasks(count: int, split: bool = False) -> list[MixedPosition]:
    """The mean of the tool points and their differences along a chain, in the plane.

    Args:
        count: Number of robots.
        split: Whether each difference is a subtask of its own.
    """
    names = [f"{i + 1}-{i + 2}" for i in range(count - 1)]
    edges = np.array([np.eye(count)[a] - np.eye(count)[b] for a, b in pairwise(range(count))])
    mean = np.full((1, count), 1.0 / count)
    cooperative = MixedPosition("cooperative", ("cooperative",), ("x", "y"), mean)
    if not split:
        return [cooperative, MixedPosition("relative", tuple(names), ("x", "y"), edges)]
    apart = [
        MixedPosition(name, (name,), ("x", "y"), row[None])
        for name, row in zip(names, edges, strict=True)
    ]
    return [cooperative, *apart]


def stack_of(subtasks: Sequence[MixedPosition], state: TeamState) -> SubtaskState:
    """Values and Jacobians of several subtasks, one above the other."""
    parts = [subtask.evaluate(state) for subtask in subtasks]
    return SubtaskState(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in ("x", "J", "J_rate"))
    )


def slices_of(subtasks: Sequence[MixedPosition]) -> tuple[slice, ...]:
    """Coordinates of each of several stacked subtasks."""
    ends = np.cumsum([subtask.dim for subtask in subtasks]).tolist()
    return tuple(slice(end - task.dim, end) for end, task in zip(ends, subtasks, strict=True))
