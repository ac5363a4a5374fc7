# SPDX-License-Identifier: Apache-2.0
"""Dynamics and tool Jacobians robot by robot, without the zero blocks of the team's matrices."""

import numpy as np
import pinocchio as pin

from noninteract_ros.arrays import Array
from noninteract_ros.control.fast.kernels.array_parts import ROBOT_ARRAYS, Indices
from noninteract_ros.control.fast.kernels.robots import Poses, Tools, gather
from noninteract_ros.team.joined_model import append_model
from noninteract_ros.team.team import Team


class RobotTerms:
    """Terms of N robots with at most m joints, computed by Pinocchio one robot at a time.

    Robots with fewer joints than m have ones on the diagonal of M, zeros elsewhere. For a team of
    prismatic joints only the tool points change, and Pinocchio is called once.

    Args:
        team: The robots.

    Attributes:
        m: Largest number of joints of a robot.
        joints: Index of each of the team's joints among N m padded ones, shape (n,).
        poses: Frames of the tools' joints, with twists at the world's origin, of `evaluate`.
    """

    def __init__(self, team: Team) -> None:
        self._team = team
        sizes = [robot.model.nv for robot in team.robots]
        N, m = len(sizes), max(sizes)
        self.m = m
        self.joints: Indices = np.concatenate([k * m + np.arange(n) for k, n in enumerate(sizes)])
        self.poses = Poses(
            jacobians=np.zeros((N, 6, m)),
            rates=np.zeros((N, 6, m)),
            positions=np.zeros((N, 3)),
            rotations=np.zeros((N, 3, 3)),
            twists=np.zeros((N, 6)),
        )
        self._start = np.zeros((ROBOT_ARRAYS, N, m, m))
        self._start[0] = np.eye(m)
        self._translations, self._rotations = np.zeros((N, 3)), np.zeros((N, 3, 3))
        self._moves = np.zeros((N, m))
        self._parts: list[tuple[pin.Model, pin.Data, slice, slice, tuple[Array, ...]]] = []
        start = 0
        for k, robot in enumerate(team.robots):
            model = append_model(pin.Model(), robot.model, robot.base_pose)
            model.gravity.linear = team.model.gravity.linear
            in_q, start = slice(start, start + model.nq), start + model.nq
            self._add(k, model, model.getFrameId(robot.tool_frame), in_q, team.velocity_slices[k])
        self._gravity = [data.g for _, data, *_ in self._parts]
        self._constant: tuple[Array, Array, list[Array]] | None = None
        if team.prismatic:
            terms, g = self._evaluate(np.zeros_like(team.q0), np.zeros(team.n))
            self._constant = terms, g, [array.copy() for array in self.poses]

    def _add(self, k: int, model: pin.Model, tool: int, in_q: slice, in_v: slice) -> None:
        """Add the data of one robot; views of Pinocchio's arrays avoid copies."""
        data, frame = model.createData(), model.frames[tool]
        joint = frame.parentJoint
        self._translations[k] = frame.placement.translation
        self._rotations[k] = frame.placement.rotation
        for number in model.supports[joint]:
            if number:
                self._moves[k, model.joints[number].idx_v] = 1.0
        pose, n = data.oMi[joint], model.nv
        square = (array.reshape(n, n, order="F") for array in (data.M, data.C))
        # Pinocchio's J of a single joint has shape (6,).
        wide = (array.reshape(6, n, order="F") for array in (data.J, data.dJ))
        views = *square, *wide, pose.translation, pose.rotation
        self._parts.append((model, data, in_q, in_v, views))

    def tools(self, rows: Indices, rotates: bool, offsets: Array | None, chosen: Array) -> Tools:
        """Return the constants of the tools.

        Args:
            rows: Axes in use, out of 0, 1 and 2.
            rotates: True if the tools' rotations are used.
            offsets: Constant rotations of the tools, shape (N, 3, 3), or None.
            chosen: T of the chosen joints and of the padding, shape (N, m, m).
        """
        rotations = self._rotations if offsets is None else self._rotations @ offsets
        return Tools(
            rows=rows,
            rotates=rotates,
            translations=self._translations,
            rotations=rotations,
            moves=self._moves,
            chosen=chosen,
        )

    def evaluate(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return blocks of `array_parts.RobotArrays` with M and C, and gravity torque, (n,)."""
        if self._constant is None:
            return self._evaluate(q, v)
        terms, g, poses = self._constant
        for array, constant in zip(self.poses, poses, strict=True):
            array[:] = constant
        padded_q = np.zeros((len(terms[0]), self.m, 1))
        padded_q.reshape(-1)[self.joints] = q
        positions = self.poses.positions
        positions += (self.poses.jacobians[:, :3] @ padded_q)[..., 0]
        return terms.copy(), g

    def _evaluate(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Compute the terms with Pinocchio."""
        blocks = self._start.copy()
        for k, (model, data, in_q, in_v, views) in enumerate(self._parts):
            q_k, v_k = q[in_q], v[in_v]
            pin.computeAllTerms(model, data, q_k, v_k)
            pin.computeCoriolisMatrix(model, data, q_k, v_k)
            gather(k, blocks, self.poses, *views)
        return blocks, np.concatenate(self._gravity)
