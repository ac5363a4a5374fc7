# SPDX-License-Identifier: Apache-2.0
"""Robot of a team: a Pinocchio model with a tool frame."""

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from noninteract_ros.arrays import Array

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Robot:
    """Torque-controlled robot, equation (1).

    Limits, armature and friction of the joints are those of the model.

    Attributes:
        name: Name in the scenario; prefix of joints and topics.
        model: Kinematics and inertia of this robot alone: joints of one degree of freedom, frames
            with different names.
        tool_frame: Name of the tool frame in `model`.
        initial_position: Initial configuration, shape (nq,).
        axes: Axes of the world along which the tool can translate.
        brake_damping: Damping of the robot's brake [N s/m or N m s/rad], one number or
            shape (nv,).
        base_pose: Pose of the base in the world.
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
        """Effort limits, shape (nv,) [N or N m]; inf where unlimited."""
        return unlimited_as_inf(self.model.upperEffortLimit)

    @property
    def velocity_limits(self) -> Array:
        """Velocity limits, shape (nv,) [m/s or rad/s]; inf where unlimited."""
        return unlimited_as_inf(self.model.upperVelocityLimit)

    @property
    def position_limits(self) -> Array:
        """Lower and upper position limits, shape (2, nv) [m or rad]; -inf, inf where unlimited."""
        return position_limits(self.model)


def position_limits(model: pin.Model) -> Array:
    """Return lower and upper position limits, shape (2, nv) [m or rad]; -inf, inf if unlimited."""
    limits = np.tile([[-np.inf], [np.inf]], model.nv)
    for joint in list(model.joints)[1:]:
        if joint.nq == 1:  # Continuous joints have no limits.
            limits[0, joint.idx_v] = model.lowerPositionLimit[joint.idx_q]
            limits[1, joint.idx_v] = model.upperPositionLimit[joint.idx_q]
    return unlimited_as_inf(limits)


def unlimited_as_inf(limits: Array) -> Array:
    """Return limits with infinity in place of the largest float, Pinocchio's mark for no limit."""
    largest = np.finfo(float).max
    return np.where(np.abs(limits) >= largest, np.copysign(np.inf, limits), limits)
