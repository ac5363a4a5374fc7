# SPDX-License-Identifier: Apache-2.0
"""Joint settings of a robot: limits, friction, armature."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from noninteract_ros.arrays import Array
from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import join, key
from noninteract_ros.team.joint_coordinates import JointCoordinates
from noninteract_ros.team.robot import position_limits
from noninteract_ros.team.robot_topics import RobotTopics

ROUNDING = 1e-9  # [m or rad] tolerance of position limits


@dataclass(frozen=True, kw_only=True)
class JointSettings(RobotTopics):
    """Joint keys common to all robots: each has one number for all joints, or one per joint.

    Friction acts in the simulation only. The controller does not know it, as it does not know
    the friction of a real joint: for the law it is a passive external torque.
    """

    effort_limit: tuple[float, ...] = key(
        "Effort limit [N or N m]; by default the limit of the model, if any", (), positive=True
    )
    velocity_limit: tuple[float, ...] = key(
        "Velocity limit [m/s or rad/s]; by default the limit of the model, if any",
        (),
        positive=True,
    )
    lower_limit: tuple[float, ...] = key(
        "Lower position limit [m or rad]; by default the limit of the model, if any", ()
    )
    upper_limit: tuple[float, ...] = key(
        "Upper position limit [m or rad]; by default the limit of the model, if any", ()
    )
    friction: tuple[float, ...] = key(
        "Viscous friction of the simulated joints [N s/m or N m s/rad]; by default none",
        (),
        minimum=0.0,
    )
    armature: tuple[float, ...] = key(
        "Rotor inertia reflected to the joint [kg or kg m^2]; by default none", (), minimum=0.0
    )

    def apply_to(self, name: str, model: pin.Model) -> None:
        """Write the given limits, friction and armature into a robot's model.

        Args:
            name: Name of the robot, for error messages.
            model: Model of the robot, which is modified.

        Raises:
            ScenarioError: A list has the wrong length, limits contradict each other, or the topics
                do not fit the joints.
        """
        self.check_topics(name, joint_names(model))
        nothing = np.zeros(model.nv)
        model.damping = self._spread(name, model, "friction", nothing)
        model.armature = self._spread(name, model, "armature", nothing)
        model.upperEffortLimit = self._spread(name, model, "effort_limit", model.upperEffortLimit)
        model.lowerEffortLimit = -model.upperEffortLimit
        speeds = self._spread(name, model, "velocity_limit", model.upperVelocityLimit)
        model.upperVelocityLimit, model.lowerVelocityLimit = speeds, -speeds
        self._limit_positions(name, model)

    def _spread(self, name: str, model: pin.Model, entry: str, default: Array) -> Array:
        given = getattr(self, entry)
        return per_joint(join(name, entry), given, joint_names(model)) if given else default

    def _limit_positions(self, name: str, model: pin.Model) -> None:
        for entry in ("lower_limit", "upper_limit"):
            if not getattr(self, entry):
                continue
            limits = self._spread(name, model, entry, np.zeros(0))
            if model.nq != model.nv:
                allowed = "nothing: this robot has continuous joints, which have no limits"
                raise ScenarioError(join(name, entry), list(getattr(self, entry)), allowed)
            if entry == "lower_limit":
                model.lowerPositionLimit = limits
            else:
                model.upperPositionLimit = limits
        crossed = model.lowerPositionLimit > model.upperPositionLimit
        if crossed.any():
            joint = int(crossed.argmax())
            found = f"{model.upperPositionLimit[joint]:g} for {joint_names(model)[joint]}"
            allowed = f">= {model.lowerPositionLimit[joint]:g}, its lower limit"
            raise ScenarioError(join(name, "upper_limit"), found, allowed)
        low, high = position_limits(model)
        if (low == high).any():  # Such as limits that a URDF leaves out, which are then 0.
            joint = int((low == high).argmax())
            at = f"{joint_names(model)[joint]} that can only be at {low[joint]:g}"
            allowed = "lower_limit and upper_limit, or an entry in locked_joints"
            raise ScenarioError(join(name, "lower_limit"), f"joint {at}", allowed)


def joint_names(model: pin.Model) -> list[str]:
    """Return the names of the joints of a model, without the universe."""
    return list(model.names)[1:]


def per_joint(key: str, values: Sequence[float], joints: Sequence[str]) -> Array:
    """Expand one number for all joints, or one per joint, to shape (n,).

    Args:
        key: Full key, for error messages.
        values: One number, or one per joint.
        joints: Names of the joints.

    Raises:
        ScenarioError: The count is neither 1 nor the number of joints.
    """
    if len(values) not in (1, len(joints)):
        allowed = f"1 number, or {len(joints)}: one per joint {list(joints)}"
        raise ScenarioError(key, list(values), allowed)
    return np.full(len(joints), values[0]) if len(values) == 1 else np.array(values)


def configuration_within(
    key: str, values: Sequence[float], model: pin.Model, limits: Array
) -> Array:
    """Return the configuration, shape (nq,), of joint positions within limits.

    Args:
        key: Full key, for error messages.
        values: Position of each joint [m or rad]; empty for zeros.
        model: Model of the robot.
        limits: Lower and upper positions, shape (2, nv).

    Raises:
        ScenarioError: The count is wrong, or a joint is beyond its limits.
    """
    joints = joint_names(model)
    if values and len(values) != len(joints):
        allowed = f"{len(joints)} numbers, one per joint {joints}"
        raise ScenarioError(key, list(values), allowed)
    positions = np.array(values) if values else np.zeros(len(joints))
    beyond = (positions < limits[0] - ROUNDING) | (positions > limits[1] + ROUNDING)
    if beyond.any():
        joint = int(beyond.argmax())
        low, high = limits[:, joint]
        found = f"{positions[joint]:g} for {joints[joint]}{'' if values else ' by default'}"
        raise ScenarioError(key, found, f">= {low:g} and <= {high:g}, the joint's limits")
    return JointCoordinates(model).configuration(positions)
