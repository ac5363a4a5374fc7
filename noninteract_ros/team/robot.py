# SPDX-License-Identifier: Apache-2.0
"""One robot of a team: a Pinocchio model with a tool frame."""

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from noninteract_ros.arrays import Array

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Robot:
    """A torque-controlled robot, equation (1).

    Limits, armature and friction of its joints are those of the model.

    Attributes:
        name: Name in the scenario; prefixes its joints and its topics.
        model: Kinematics and inertia of this robot alone: joints of one degree of freedom, frames
            with different names.
        tool_frame: Name of the frame that works, in `model`.
        initial_position: Configuration at the start, shape (nq,).
        axes: Axes of the world along which the tool can translate.
        brake_damping: Damping of the robot's own brake [N s/m or N m s/rad], one number or
            shape (nv,).
        base_pose: Pose of its base in the world.
    """

    name: str
    model: pin.Model
    tool_frame: str
    initial_position: Array
    axes: tuple[str, ...]
    brake_damping: Array | float
    base_pose: pin.SE3 = field(default_factory=pin.SE3.Identity)

    @property
    def effort_limits(self) -> Array:
        """Largest torque of each joint, shape (nv,) [N or N m]; inf where there is none."""
        return unlimited_as_inf(self.model.upperEffortLimit)

    @property
    def velocity_limits(self) -> Array:
        """Largest speed of each joint, shape (nv,) [m/s or rad/s]; inf where there is none."""
        return unlimited_as_inf(self.model.upperVelocityLimit)

    @property
    def position_limits(self) -> Array:
        """Lowest and highest position of each joint, shape (2, nv) [m or rad]; else -inf, inf."""
        return position_limits(self.model)


def position_limits(model: pin.Model) -> Array:
    """Lowest and highest position of each joint, shape (2, nv) [m or rad]; else -inf, inf."""
    limits = np.tile([[-np.inf], [np.inf]], model.nv)
    for joint in list(model.joints)[1:]:
        if joint.nq == 1:  # A continuous joint has none.
            limits[0, joint.idx_v] = model.lowerPositionLimit[joint.idx_q]
            limits[1, joint.idx_v] = model.upperPositionLimit[joint.idx_q]
    return unlimited_as_inf(limits)


def unlimited_as_inf(limits: Array) -> Array:
    """Limits with infinity where Pinocchio means none by the largest number."""
    largest = np.finfo(float).max
    return np.where(np.abs(limits) >= largest, np.copysign(np.inf, limits), limits)
