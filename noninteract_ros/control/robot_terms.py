# SPDX-License-Identifier: Apache-2.0
"""The team robot by robot: what of M, C and the Jacobians is not zero, without the rest."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from noninteract_ros.arrays import Array
from noninteract_ros.subtasks import so3
from noninteract_ros.team.joining import append_model
from noninteract_ros.team.team import Team


@dataclass(frozen=True, slots=True)
class RobotTerms:
    """Dynamics and tool kinematics of N robots with at most m joints.

    Robots with fewer joints than m have ones on the diagonal of M, zeros elsewhere.

    Attributes:
        M: Inertia matrices, shape (N, m, m).
        C: Coriolis matrices, shape (N, m, m).
        g: Gravity torque of the team, shape (n,) [N or N m].
        positions: Tool points in the world, shape (N, 3) [m].
        rotations: Tool orientations in the world, shape (N, 3, 3).
        J: Tool twists (linear, angular) in world axes per joint velocity, shape (N, 6, m).
        J_rate: Their time derivatives, shape (N, 6, m).
        twists: Tool twists, shape (N, 6).
    """

    M: Array
    C: Array
    g: Array
    positions: Array
    rotations: Array
    J: Array
    J_rate: Array
    twists: Array


class RobotByRobot:
    """Evaluates `RobotTerms`; its cost is linear in the number of robots.

    Args:
        team: The robots.

    Attributes:
        m: Largest number of joints of a robot.
        slots: Place of each of the team's joints among N m padded ones, shape (n,).
        even: Whether all robots have m joints.
    """

    def __init__(self, team: Team) -> None:
        sizes = [robot.model.nv for robot in team.robots]
        count, m = len(sizes), max(sizes)
        self.m, self.even = m, min(sizes) == m
        self.slots = np.concatenate([k * m + np.arange(size) for k, size in enumerate(sizes)])
        self._shape, self._n = (count, m), team.n
        self._parts: list[tuple[pin.Model, pin.Data, slice, slice]] = []
        self._M, self._C = np.tile(np.eye(m), (count, 1, 1)), np.zeros((count, m, m))
        self._J, self._J_rate = np.zeros((count, 6, m)), np.zeros((count, 6, m))
        self._g, self._p, self._R = np.zeros(team.n), np.zeros((count, 3)), np.zeros((count, 3, 3))
        self._moves = np.zeros((count, 1, m))
        self._tool_p, self._tool_R = np.zeros((count, 3, 1)), np.zeros((count, 3, 3))
        self._copies: list[tuple[Array, Array]] = []
        start = 0
        for k, robot in enumerate(team.robots):
            model = append_model(pin.Model(), robot.model, robot.base_pose)
            model.gravity.linear = team.model.gravity.linear
            part = slice(start, start + model.nq)
            start += model.nq
            self._add(k, model, model.getFrameId(robot.tool_frame), part, team.velocity_slices[k])
        self._below = np.tri(m, k=-1, dtype=bool)

    def _add(self, k: int, model: pin.Model, tool: int, in_q: slice, in_v: slice) -> None:
        """Data of one robot; Pinocchio's arrays are looked at where they are."""
        data, own = model.createData(), slice(0, model.nv)
        self._parts.append((model, data, in_q, in_v))
        frame, joint = model.frames[tool], model.frames[tool].parentJoint
        self._tool_p[k, :, 0] = frame.placement.translation
        self._tool_R[k] = frame.placement.rotation
        for number in model.supports[joint]:
            if number:
                self._moves[k, 0, model.joints[number].idx_v] = 1.0
        self._copies += [
            (self._M[k, own, own], data.M),
            (self._C[k, own, own], data.C),
            (self._J[k, :, own], data.J),
            (self._J_rate[k, :, own], data.dJ),
            (self._g[in_v], data.g),
            (self._p[k], data.oMi[joint].translation),
            (self._R[k], data.oMi[joint].rotation),
        ]

    def padded(self, vector: Array) -> Array:
        """A vector or columns over the joints, shape (n, ...), by robot: shape (N, m, ...)."""
        if self.even:
            return vector.reshape(*self._shape, *vector.shape[1:])
        result = np.zeros((self._shape[0] * self.m, *vector.shape[1:]))
        result[self.slots] = vector
        return result.reshape(*self._shape, *vector.shape[1:])

    def joined(self, blocks: Array) -> Array:
        """The opposite of `padded`."""
        flat = blocks.reshape(-1, *blocks.shape[2:])
        return flat if self.even else flat[self.slots]

    def evaluate(self, q: Array, v: Array) -> RobotTerms:
        """All terms at a state of the team."""
        for model, data, in_q, in_v in self._parts:
            q_k, v_k = q[in_q], v[in_v]
            pin.computeAllTerms(model, data, q_k, v_k)
            pin.computeCoriolisMatrix(model, data, q_k, v_k)
        for target, source in self._copies:
            target[...] = source
        M = np.where(self._below, self._M.transpose(0, 2, 1), self._M)  # The upper one is filled.
        positions = self._p + (self._R @ self._tool_p)[..., 0]
        # Pinocchio's columns are twists at the world's origin.
        turning, turning_rate = self._J[:, 3:] * self._moves, self._J_rate[:, 3:] * self._moves
        arm = so3.hat(positions)
        linear = self._J[:, :3] * self._moves - arm @ turning
        J = np.concatenate([linear, turning], axis=1)
        twists = (J @ self.padded(v)[..., None])[..., 0]
        carried = arm @ turning_rate + so3.hat(twists[:, :3]) @ turning
        linear_rate = self._J_rate[:, :3] * self._moves - carried
        J_rate = np.concatenate([linear_rate, turning_rate], axis=1)
        rotations = self._R @ self._tool_R
        return RobotTerms(
            M, self._C.copy(), self._g.copy(), positions, rotations, J, J_rate, twists
        )
