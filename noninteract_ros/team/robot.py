# SPDX-License-Identifier: Apache-2.0
"""One robot of a team: a Pinocchio model with a tool frame."""

from dataclasses import dataclass

import pinocchio as pin

from noninteract_ros.arrays import Array

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Robot:
    """A torque-controlled robot, equation (1).

    Attributes:
        name: Name in the scenario; prefixes its joints and its topics.
        model: Kinematics and inertia of this robot alone.
        tool_frame: Name of the frame that works, in `model`.
        initial_position: Configuration at the start, shape (nq,).
        axes: Axes of the world along which the tool can translate.
        brake_damping: Damping of the robot's own brake [N s/m or N m s/rad].
    """

    name: str
    model: pin.Model
    tool_frame: str
    initial_position: Array
    axes: tuple[str, ...]
    brake_damping: float
