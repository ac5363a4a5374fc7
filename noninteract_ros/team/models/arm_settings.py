# SPDX-License-Identifier: Apache-2.0
"""What every arm has in a scenario: a place, a posture to start from, brakes."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import join, key
from noninteract_ros.team.base_pose import base_pose
from noninteract_ros.team.joint_settings import (
    JointSettings,
    configuration_within,
    joint_names,
    per_joint,
)
from noninteract_ros.team.robot import AXES, Robot, position_limits

_TRIALS = 4


@dataclass(frozen=True, kw_only=True)
class ArmSettings(JointSettings):
    """Keys that arms of every kind have."""

    base_pose: tuple[float, ...] = key(
        "Pose of the base in the world: x y z [m], quaternion qx qy qz qw",
        (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
    )
    initial_position: tuple[float, ...] = key(
        "Initial position of each joint that moves [m or rad]; by default zeros", ()
    )
    brake_damping: tuple[float, ...] = key(
        "Joint damping of its own brake without commands, for all joints or one per joint"
        " [N s/m or N m s/rad]",
        (5.0,),
        minimum=0.0,
    )

    def arm(self, name: str, model: pin.Model, tool_frame: str) -> Robot:
        """The robot of a model, which is equipped with the joint settings here.

        Raises:
            ScenarioError: A key does not fit the model.
        """
        self.apply_to(name, model)
        base = base_pose(join(name, "base_pose"), self.base_pose)
        brakes = per_joint(join(name, "brake_damping"), self.brake_damping, joint_names(model))
        axes = tool_axes(model, tool_frame, base)
        start = configuration_within(
            join(name, "initial_position"), self.initial_position, model, position_limits(model)
        )
        _check_inertia(name, model, start)
        return Robot(name, model, tool_frame, start, axes, brakes, base)


def tool_axes(model: pin.Model, tool_frame: str, base: pin.SE3) -> tuple[str, ...]:
    """Axes of the world along which the tool moves, at some configurations at least."""
    data, tool = model.createData(), model.getFrameId(tool_frame)
    rng = np.random.default_rng(0)
    reach = np.zeros(3)
    for _ in range(_TRIALS):
        q = pin.integrate(model, pin.neutral(model), rng.uniform(-1.0, 1.0, model.nv))
        J = pin.computeFrameJacobian(model, data, q, tool, pin.LOCAL_WORLD_ALIGNED)
        linear = J.reshape(6, model.nv)[:3]  # Of a single joint it is a vector.
        reach = np.maximum(reach, np.abs(base.rotation @ linear).max(axis=1))
    moves = reach > 1e-9 * max(1.0, float(reach.max()))
    return tuple(axis for axis, it_moves in zip(AXES, moves, strict=True) if it_moves)


def _check_inertia(name: str, model: pin.Model, q: np.ndarray) -> None:
    """Refuses joints that accelerate without any torque."""
    M = pin.crba(model, model.createData(), q).reshape(model.nv, model.nv)
    inertias = np.linalg.eigvalsh(M, UPLO="U")
    if inertias.min() <= 1e-12 * max(1.0, inertias.max()):
        weak = joint_names(model)[int(np.argmin(np.diag(M)))]
        found = f"joints that move no mass, such as {weak}"
        raise ScenarioError(name, found, "links with inertia, or `armature` at such joints")
