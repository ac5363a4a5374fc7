# SPDX-License-Identifier: Apache-2.0
"""Kinematics of the drawn team: measured configuration and a ghost at the desired values."""

import numpy as np
import pinocchio as pin

from noninteract_ros.arrays import Array
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team

DAMPING = 1e-3  # relative to the largest singular value; keeps the ghost steady near singularities
MAX_GHOST_STEP = 0.5  # [m or rad] per frame


class SceneKinematics:
    """Joint and tool poses of the team, and a configuration that reaches the desired values.

    Args:
        team: The robots; not shared with other threads.
        stack: The subtasks.
    """

    def __init__(self, team: Team, stack: SubtaskStack) -> None:
        self._team, self._stack = team, stack
        self._data = team.model.createData()
        self._zero = np.zeros(team.n)
        self._ghost: Array | None = None

    def joints(self, q: Array) -> Array:
        """Return the poses of all joints but the world, shape (joints, 7).

        A pose is x, y, z, quaternion x, y, z, w.
        """
        pin.forwardKinematics(self._team.model, self._data, q)
        placements = self._data.oMi
        return np.array([pin.SE3ToXYZQUAT(placements[i]) for i in range(1, len(placements))])

    def ghost(self, q: Array, desired: Array) -> Array:
        """Return a configuration whose subtasks have their desired values, shape (nq,).

        Takes one damped Newton step on phi(q) = x_d per call, from the last result. The stacked
        Jacobian is square, and references move little from frame to frame.

        Args:
            q: Measured configuration, shape (nq,).
            desired: Desired values of all subtasks, stacked, shape (size,).
        """
        start = q if self._ghost is None else self._ghost
        state = self._team.state(start, self._zero)
        task = self._stack.evaluate(state)
        error = self._stack.difference(desired, task.x)
        u, sigma, vt = np.linalg.svd(task.J)
        inverse = sigma / (sigma**2 + (DAMPING * sigma[0]) ** 2)
        step = vt.T @ (inverse * (u.T @ error))
        largest = float(np.abs(step).max())
        if not np.isfinite(largest):
            return start
        step *= min(1.0, MAX_GHOST_STEP / max(largest, 1e-12))
        self._ghost = self._team.integrate(start, step)
        return self._ghost

    def reset_ghost(self) -> None:
        """Start the next ghost at the measured configuration."""
        self._ghost = None

    def tools(self, q: Array) -> Array:
        """Return the tool points, shape (N, 3) [m]."""
        return self._team.state(q, self._zero).tool_positions
