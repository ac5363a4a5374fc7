# SPDX-License-Identifier: Apache-2.0
"""Collision bodies fixed to joints, and those of the links of a robot."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull

from noninteract_ros.arrays import Array
from noninteract_ros.team.geometry.fitting import Capsule, capsule_around
from noninteract_ros.team.geometry.hulls import geometry_hull
from noninteract_ros.team.geometry.links import LinkShape, default_link_radius, segments
from noninteract_ros.team.robot import Robot
from noninteract_ros.team.team import Team


@dataclass(frozen=True)
class Body:
    """Collision body fixed to a joint.

    Attributes:
        name: Name of the body, `<owner>/<link>` or that of a surrounding.
        owner: Robot or surrounding of the body.
        joint: Joint of the body in the team's model; 0 is the world.
        capsule: Shape of the body, or a capsule around it if it is convex; for a plane, a point of
            it and the point one normal above.
        convex: Geometry of coal in the joint's frame; None for a capsule and for a plane.
        hull: Convex hull of a link that a capsule stands for, in the joint's frame; None without.
        plane: True for a half-space, which belongs to the world.
        touches: Joints whose bodies it touches by design, such as those of grippers.
    """

    name: str
    owner: str
    joint: int
    capsule: Capsule
    convex: Any = None
    hull: Any = None
    plane: bool = False
    touches: frozenset[int] = frozenset()


def convex_body(points: Array) -> Any:
    """Return the convex coal geometry around points, shape (m, 3) [m]."""
    corners = coal.StdVec_Vec3s()
    for point in points:
        corners.append(point)
    return coal.Convex.convexHull(corners, True, "Qt")


def link_bodies(robot: Robot, shapes: Sequence[LinkShape], team: Team) -> list[Body]:
    """Bodies of a robot's links, one per link.

    Args:
        robot: The robot.
        shapes: Collision geometry of its links; without any, links are sticks.
        team: The team, whose joints carry the bodies.
    """
    found: dict[tuple[str, int], list[Array]] = {}
    for shape in shapes:
        hull = geometry_hull(shape.geometry)
        if hull is not None:
            points = hull.points @ shape.placement.rotation.T + shape.placement.translation
            found.setdefault((shape.link, shape.joint), []).append(points)
    bodies = []
    for (link, joint), parts in found.items():
        points = np.concatenate(parts)
        points = points[ConvexHull(points).vertices]
        body = Body(link, robot.name, joint, capsule_around(points), hull=convex_body(points))
        bodies.append(_placed(robot, team, body))
    return bodies or _default_bodies(robot, team)


def _default_bodies(robot: Robot, team: Team) -> list[Body]:
    """Return the bodies of a robot without collision geometry."""
    ends = segments(robot)
    moving = [item for item in ends if item[0] > 0]
    if not any(end.any() for _, end in moving):  # A point mass.
        point = Capsule(np.zeros(3), np.zeros(3), 0.0)
        return [_placed(robot, team, Body(robot.tool_frame, robot.name, ends[-1][0], point))]
    radius = default_link_radius(ends)
    return [
        _placed(
            robot,
            team,
            Body(f"link_{joint}", robot.name, joint, Capsule(np.zeros(3), end, radius)),
        )
        for joint, end in moving
        if end.any()
    ]


def _placed(robot: Robot, team: Team, body: Body) -> Body:
    """Return a body on a joint of the robot's own model, as one on a joint of the team's."""
    body = replace(body, name=f"{robot.name}/{body.name}")
    if body.joint == 0:
        return moved(body, robot.base_pose, 0)
    joint = team.model.getJointId(f"{robot.name}/{robot.model.names[body.joint]}")
    return replace(body, joint=joint)


def moved(body: Body, pose: pin.SE3, joint: int) -> Body:
    """Return a body fixed to another joint, given the pose of its old frame in the new joint's."""
    capsule = Capsule(
        pose.act(body.capsule.start), pose.act(body.capsule.end), body.capsule.radius
    )
    convex, hull = (_moved_convex(shape, pose) for shape in (body.convex, body.hull))
    return replace(body, joint=joint, capsule=capsule, convex=convex, hull=hull)


def _moved_convex(shape: Any, pose: pin.SE3) -> Any:
    if shape is None:
        return None
    return convex_body(shape.points() @ pose.rotation.T + pose.translation)
