# SPDX-License-Identifier: Apache-2.0
"""Shapes of a robot's links: those of its URDF, or sticks from joint to joint."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from noninteract_ros.arrays import Array
from noninteract_ros.team.geometry import hulls
from noninteract_ros.team.geometry.hulls import Hull
from noninteract_ros.team.models.urdf_files import share_folders
from noninteract_ros.team.robot import Robot

STICK = 0.07  # radius of a link without geometry, as a share of the longest link


@dataclass(frozen=True)
class LinkShape:
    """A collision geometry of a link.

    Attributes:
        link: Name of the link.
        joint: Joint of the robot's own model that carries it; 0 is the base.
        geometry: Geometry of coal.
        placement: Its pose in the joint's frame.
    """

    link: str
    joint: int
    geometry: Any
    placement: pin.SE3


def urdf_shapes(urdf: str, robot: Robot) -> Iterator[LinkShape]:
    """Collision geometry of a URDF on the joints of a robot's own model.

    Args:
        urdf: Text of the URDF.
        robot: The robot, maybe with locked joints.

    Raises:
        ValueError: A mesh is missing.
    """
    full = pin.buildModelFromXML(urdf)
    folders = [str(folder) for folder in share_folders()]
    geometry = pin.buildGeomFromUrdfString(full, urdf, pin.COLLISION, package_dirs=folders)
    for item in geometry.geometryObjects:
        link = full.frames[item.parentFrame]
        frame = robot.model.frames[robot.model.getFrameId(link.name, pin.FrameType.BODY)]
        place = frame.placement * link.placement.inverse() * item.placement
        yield LinkShape(link.name, int(frame.parentJoint), item.geometry, place)


def segments(robot: Robot) -> list[tuple[int, Array]]:
    """Joint and end of each link from its joint to those that follow, and to the tool."""
    model = robot.model
    tool = model.frames[model.getFrameId(robot.tool_frame)]
    ends: list[tuple[int, Array]] = [
        (int(model.parents[joint]), model.jointPlacements[joint].translation)
        for joint in range(1, model.njoints)
    ]
    ends.append((int(tool.parentJoint), tool.placement.translation))
    return ends


def stick_radius(ends: list[tuple[int, Array]]) -> float:
    """Radius of links without geometry [m]."""
    return STICK * (max(float(np.linalg.norm(end)) for _, end in ends) or 1.0)


def sticks(robot: Robot) -> list[tuple[int, Hull]]:
    """Base and links as hulls, from each joint to those that follow."""
    ends = segments(robot)
    radius = stick_radius(ends)
    longest = radius / STICK
    return [(0, hulls.cylinder(2.0 * radius, 2.0 * radius))] + [
        (parent, hulls.capsule(np.zeros(3), end, radius))
        for parent, end in ends
        if np.linalg.norm(end) > 0.01 * longest
    ]
