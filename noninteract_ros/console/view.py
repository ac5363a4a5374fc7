# SPDX-License-Identifier: Apache-2.0
"""Where everything is that the page draws: the team, its references, what is around it."""

import numpy as np
import pinocchio as pin

from noninteract_ros.arrays import Array
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team

DAMPING = 1e-3  # relative to the largest singular value: ghosts stay calm near singularities
LARGEST_STEP = 0.5  # [m or rad] of a ghost from picture to picture


class SceneState:
    """Poses of the team's joints, as it is and as its references ask for.

    Args:
        team: The robots; not shared with other threads.
        stack: Their subtasks.
    """

    def __init__(self, team: Team, stack: SubtaskStack) -> None:
        self._team, self._stack = team, stack
        self._data = team.model.createData()
        self._still = np.zeros(team.n)
        self._ghost: Array | None = None

    def joints(self, q: Array) -> Array:
        """Poses x, y, z, quaternion x, y, z, w of all joints but the world, shape (joints, 7)."""
        pin.forwardKinematics(self._team.model, self._data, q)
        placements = self._data.oMi
        return np.array([pin.SE3ToXYZQUAT(placements[i]) for i in range(1, len(placements))])

    def ghost(self, q: Array, desired: Array) -> Array:
        """Configuration whose subtasks have their desired values, shape (nq,).

        One damped Newton step on phi(q) = x_d per call, from the last result: the stacked Jacobian
        is square, and references move little from picture to picture.

        Args:
            q: Where the team is, shape (nq,).
            desired: Desired values of all subtasks, stacked, shape (size,).
        """
        start = q if self._ghost is None else self._ghost
        state = self._team.state(start, self._still)
        task = self._stack.evaluate(state)
        gap = self._stack.difference(desired, task.x)
        u, sizes, vt = np.linalg.svd(task.J)
        inverse = sizes / (sizes**2 + (DAMPING * sizes[0]) ** 2)
        step = vt.T @ (inverse * (u.T @ gap))
        largest = float(np.abs(step).max())
        if not np.isfinite(largest):
            return start
        step *= min(1.0, LARGEST_STEP / max(largest, 1e-12))
        self._ghost = self._team.integrate(start, step)
        return self._ghost

    def forget(self) -> None:
        """Has the next ghost begin where the team is."""
        self._ghost = None

    def tools(self, q: Array) -> Array:
        """Tool points, shape (N, 3) [m]."""
        return self._team.state(q, self._still).tool_positions
