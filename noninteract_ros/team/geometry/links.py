# SPDX-License-Identifier: Apache-2.0
"""Shapes of a robot's links: those of its URDF, or capsules from joint to joint."""

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

LINK_RADIUS = 0.07  # of a link without geometry, as a share of the longest link


@dataclass(frozen=True)
class LinkShape:
    """Collision geometry of a link.

    Attributes:
        link: Name of the link.
        joint: Joint of the robot's own model that the link is fixed to; 0 is the base.
        geometry: Coal geometry.
        placement: Pose in the joint's frame.
    """

    link: str
    joint: int
    geometry: Any
    placement: pin.SE3


def urdf_shapes(urdf: str, robot: Robot) -> Iterator[LinkShape]:
    """Iterate over the collision geometry of a URDF, on the joints of a robot's own model.

    Args:
        urdf: Text of the URDF.
        robot: Robot of the URDF, possibly with locked joints.

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
    """Return joint and end point of each link segment, to following joints and the tool."""
    model = robot.model
    tool = model.frames[model.getFrameId(robot.tool_frame)]
    ends: list[tuple[int, Array]] = [
        (int(model.parents[joint]), model.jointPlacements[joint].translation)
        for joint in range(1, model.njoints)
    ]
    ends.append((int(tool.parentJoint), tool.placement.translation))
    return ends


def default_link_radius(ends: list[tuple[int, Array]]) -> float:
    """Return the radius of links without geometry [m]."""
    return LINK_RADIUS * (max(float(np.linalg.norm(end)) for _, end in ends) or 1.0)


def link_capsules(robot: Robot) -> list[tuple[int, Hull]]:
    """Return the hulls of a base and of capsules from each joint to the following ones."""
    ends = segments(robot)
    radius = default_link_radius(ends)
    longest = radius / LINK_RADIUS
    return [(0, hulls.cylinder(2.0 * radius, 2.0 * radius))] + [
        (parent, hulls.capsule(np.zeros(3), end, radius))
        for parent, end in ends
        if np.linalg.norm(end) > 0.01 * longest
    ]
