# SPDX-License-Identifier: Apache-2.0
"""Settings common to all arms: base pose, initial position, brake damping."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import join, key
from noninteract_ros.team.joint_settings import (
    JointSettings,
    configuration_within,
    joint_names,
    per_joint,
)
from noninteract_ros.team.pose_from_list import pose_from_list
from noninteract_ros.team.robot import AXES, Robot, position_limits

_TRIALS = 4


@dataclass(frozen=True, kw_only=True)
class ArmSettings(JointSettings):
    """Keys common to arms of every kind."""

    base_pose: tuple[float, ...] = key(
        "Pose of the base in the world: x y z [m], quaternion qx qy qz qw",
        (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
    )
    initial_position: tuple[float, ...] = key(
        "Initial position of each movable joint [m or rad]; by default zeros", ()
    )
    brake_damping: tuple[float, ...] = key(
        "Joint damping of the robot's brake, which acts while no commands arrive; one number for"
        " all joints or one per joint [N s/m or N m s/rad]",
        (5.0,),
        minimum=0.0,
    )

    def robot(self, name: str, model: pin.Model, tool_frame: str) -> Robot:
        """Return the robot of a model, after writing the joint settings into the model.

        Raises:
            ScenarioError: A key does not fit the model.
        """
        self.apply_to(name, model)
        base = pose_from_list(join(name, "base_pose"), self.base_pose)
        brakes = per_joint(join(name, "brake_damping"), self.brake_damping, joint_names(model))
        axes = tool_axes(model, tool_frame, base)
        start = configuration_within(
            join(name, "initial_position"), self.initial_position, model, position_limits(model)
        )
        _check_inertia(name, model, start)
        return Robot(
            name=name,
            model=model,
            tool_frame=tool_frame,
            initial_position=start,
            axes=axes,
            brake_damping=brakes,
            base_pose=base,
        )


def tool_axes(model: pin.Model, tool_frame: str, base: pin.SE3) -> tuple[str, ...]:
    """Return the world axes along which the tool can translate, from random configurations."""
    data, tool = model.createData(), model.getFrameId(tool_frame)
    rng = np.random.default_rng(0)
    reach = np.zeros(3)
    for _ in range(_TRIALS):
        q = pin.integrate(model, pin.neutral(model), rng.uniform(-1.0, 1.0, model.nv))
        J = pin.computeFrameJacobian(model, data, q, tool, pin.LOCAL_WORLD_ALIGNED)
        linear = J.reshape(6, model.nv)[:3]  # A vector for a single joint.
        reach = np.maximum(reach, np.abs(base.rotation @ linear).max(axis=1))
    moves = reach > 1e-9 * max(1.0, float(reach.max()))
    return tuple(axis for axis, it_moves in zip(AXES, moves, strict=True) if it_moves)


def _check_inertia(name: str, model: pin.Model, q: np.ndarray) -> None:
    """Check that the inertia matrix is positive-definite.

    Raises:
        ScenarioError: A joint moves no mass.
    """
    M = pin.crba(model, model.createData(), q).reshape(model.nv, model.nv)
    inertias = np.linalg.eigvalsh(M, UPLO="U")
    if inertias.min() <= 1e-12 * max(1.0, inertias.max()):
        weak = joint_names(model)[int(np.argmin(np.diag(M)))]
        found = f"joints that move no mass, such as {weak}"
        raise ScenarioError(name, found, "links with inertia, or `armature` at such joints")
