# SPDX-License-Identifier: Apache-2.0
"""What a team looks like: the collision geometry of its robots, on the joints of its model."""

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull, QhullError

from noninteract_ros.arrays import Array
from noninteract_ros.team.registry import RobotBlock
from noninteract_ros.team.robot import Robot
from noninteract_ros.team.team import Team
from noninteract_ros.team.urdf import UrdfRobot
from noninteract_ros.team.urdf_files import read_urdf, share_folders

SHORTEST = 1e-3  # [m] links that are shorter are not drawn
TOOL_RADIUS = 0.04  # [m] of the ball at a tool point
LINK_RADIUS = 0.03  # [m] of a link that has no geometry of its own


@dataclass(frozen=True)
class Shape:
    """A rigid thing on one joint of the team's model.

    Attributes:
        robot: Place of its robot in the team.
        joint: Number of the joint in the team's model; 0 is the world.
        placement: Pose in the joint's frame: x, y, z and quaternion x, y, z, w, shape (7,).
        kind: `box`, `sphere`, `capsule`, `cylinder` or `mesh`.
        size: Edges of a box; radius of a sphere; radius and length along z of the others [m].
        vertices: Of a mesh, shape (n, 3) [m].
        triangles: Of a mesh, places of the corners, shape (m, 3).
    """

    robot: int
    joint: int
    placement: Array
    kind: str
    size: tuple[float, ...] = ()
    vertices: Array | None = None
    triangles: Array | None = None

    def described(self) -> dict[str, Any]:
        """All but the mesh, for the page."""
        return {
            "robot": self.robot,
            "joint": self.joint,
            "placement": self.placement.round(6).tolist(),
            "kind": self.kind,
            "size": list(self.size),
        }


def team_shapes(team: Team, blocks: Mapping[str, RobotBlock]) -> list[Shape]:
    """Shapes of all robots: a URDF's collision geometry, else links between the joints.

    Args:
        team: The robots.
        blocks: Their blocks in the scenario, by name.
    """
    shapes: list[Shape] = []
    for index, robot in enumerate(team.robots):
        block = blocks[robot.name]
        found = list(_urdf_shapes(team, index, robot, block))
        shapes += found or _stick_shapes(team, index, robot)
    return shapes


def mesh_bytes(shapes: list[Shape]) -> bytes:
    """All meshes, little-endian: numbers of vertices and corners, vertices f4, corners u4."""
    parts: list[bytes] = []
    for shape in shapes:
        if shape.vertices is not None and shape.triangles is not None:
            parts.append(struct.pack("<II", len(shape.vertices), shape.triangles.size))
            parts.append(shape.vertices.astype("<f4").tobytes())
            parts.append(shape.triangles.astype("<u4").tobytes())
    return b"".join(parts)


def _urdf_shapes(team: Team, index: int, robot: Robot, block: RobotBlock) -> Iterator[Shape]:
    if not isinstance(block, UrdfRobot):
        return
    text = block.urdf_text or read_urdf(f"{robot.name}.urdf", block.urdf)
    full = pin.buildModelFromXML(text)
    folders = [str(folder) for share in share_folders() for folder in (share, share / "robots")]
    try:
        geometry = pin.buildGeomFromUrdfString(
            full, text, pin.GeometryType.COLLISION, package_dirs=folders
        )
    except (ValueError, RuntimeError):  # A mesh is missing: the robot is drawn by its joints.
        return
    for item in geometry.geometryObjects:
        link = full.frames[item.parentFrame]
        frame = team.model.frames[team.model.getFrameId(f"{robot.name}/{link.name}")]
        placement = frame.placement * link.placement.actInv(item.placement)
        drawn = _drawn(item)
        if drawn is not None:
            kind, size, vertices, triangles = drawn
            at = pin.SE3ToXYZQUAT(placement)
            yield Shape(index, frame.parentJoint, at, kind, size, vertices, triangles)


def _drawn(item: Any) -> tuple[str, tuple[float, ...], Array | None, Array | None] | None:
    """Kind, size and hull of a collision object; None for what cannot be drawn."""
    form = item.geometry
    kind = type(form).__name__
    if kind == "Box":
        return "box", tuple(2.0 * form.halfSide), None, None
    if kind == "Sphere":
        return "sphere", (form.radius,), None, None
    if kind in ("Cylinder", "Capsule"):
        return kind.lower(), (form.radius, 2.0 * form.halfLength), None, None
    if not hasattr(form, "vertices"):
        return None
    points = np.array(form.vertices()).reshape(-1, 3)  # The loader has scaled them.
    hull = convex_hull(points)
    return None if hull is None else ("mesh", (), *hull)


def convex_hull(points: Array) -> tuple[Array, Any] | None:
    """Corners (n, 3) and outward triangles (m, 3) of the hull; None of points in one plane."""
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return None
    triangles = hull.simplices.copy()
    first, second, third = (points[triangles[:, corner]] for corner in range(3))
    normals = np.cross(second - first, third - first)
    inward = np.einsum("ij,ij->i", normals, hull.equations[:, :3]) < 0.0
    triangles[inward] = triangles[inward][:, ::-1]
    kept, places = np.unique(triangles, return_inverse=True)
    return points[kept], places.reshape(-1, 3)


def _stick_shapes(team: Team, index: int, robot: Robot) -> list[Shape]:
    """A ball at the tool point and a capsule along each link that has a length."""
    model = team.model
    tool = model.frames[model.getFrameId(f"{robot.name}/{robot.tool_frame}")]
    still = pin.SE3ToXYZQUAT(tool.placement)
    shapes = [Shape(index, tool.parentJoint, still, "sphere", (TOOL_RADIUS,))]
    ends = [
        (model.parents[joint], model.jointPlacements[joint].translation)
        for joint in range(1, model.njoints)
        if model.names[joint].startswith(f"{robot.name}/") and model.parents[joint]
    ]
    ends.append((tool.parentJoint, tool.placement.translation))
    for joint, end in ends:
        length = float(np.linalg.norm(end))
        if length > SHORTEST:
            turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end)
            placement = np.concatenate([0.5 * end, turn.coeffs()])
            shapes.append(Shape(index, joint, placement, "capsule", (LINK_RADIUS, length)))
    return shapes
