# SPDX-License-Identifier: Apache-2.0
"""Obstacles of a scenario: bodies of the world that robots must not touch.

They exert no force in the simulation: a negative distance reports that a robot has entered one.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from noninteract_ros.arrays import Array
from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import join, key
from noninteract_ros.team.geometry import hulls
from noninteract_ros.team.geometry.bodies import Body, convex_body
from noninteract_ros.team.geometry.fitting import Capsule, capsule_around
from noninteract_ros.team.geometry.hulls import Hull
from noninteract_ros.team.pose_from_list import pose_from_list
from noninteract_ros.team.team import Team

EXTENT = (2.0, 2.0, 0.005)  # [m] of a drawn plane
IDENTITY_POSE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


class Obstacle:
    """Base class of the configuration blocks of obstacles."""

    def build(self, name: str, team: Team) -> tuple[list[pin.Model], list[Any]]:
        """Return no models and no couplings: obstacles exert no force in the simulation.

        Raises:
            ScenarioError: A key is no valid vector, pose or file.
        """
        self.body(name)
        return [], []

    def body(self, name: str) -> Body:
        """Return the collision body."""
        raise NotImplementedError

    def hull(self, name: str) -> Hull:
        """Return the hull in the world, for drawing."""
        body = self.body(name)
        if body.convex is not None:
            return hulls.convex_hull(np.array(body.convex.points()))
        return hulls.capsule(body.capsule.start, body.capsule.end, body.capsule.radius)


@dataclass(frozen=True)
class SphereObstacle(Obstacle):
    """Configuration block of a sphere."""

    position: tuple[float, ...] = key("Centre [m]")
    radius: float = key("Radius [m]", positive=True)
    kind: str = key("Kind of surrounding", "sphere", choices=("sphere",))

    def body(self, name: str) -> Body:
        """Return the collision body."""
        centre = _vector(join(name, "position"), self.position)
        return Body(name, name, 0, Capsule(centre, centre, self.radius))


@dataclass(frozen=True)
class CapsuleObstacle(Obstacle):
    """Configuration block of a capsule, such as a post."""

    start: tuple[float, ...] = key("Start of the centre line [m]")
    end: tuple[float, ...] = key("End of the centre line [m]")
    radius: float = key("Radius [m]", positive=True)
    kind: str = key("Kind of surrounding", "capsule", choices=("capsule",))

    def body(self, name: str) -> Body:
        """Return the collision body."""
        start = _vector(join(name, "start"), self.start)
        return Body(
            name, name, 0, Capsule(start, _vector(join(name, "end"), self.end), self.radius)
        )


@dataclass(frozen=True)
class BoxObstacle(Obstacle):
    """Configuration block of a box, such as a table."""

    size: tuple[float, ...] = key("Edge lengths along the axes of the box [m]", positive=True)
    pose: tuple[float, ...] = key("Pose of the centre: x y z [m], qx qy qz qw", IDENTITY_POSE)
    kind: str = key("Kind of surrounding", "box", choices=("box",))

    def body(self, name: str) -> Body:
        """Return the collision body."""
        size = _vector(join(name, "size"), self.size)
        corners = 0.5 * size * np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, 8).T
        return _convex(name, corners, pose_from_list(join(name, "pose"), self.pose))


@dataclass(frozen=True)
class PlaneObstacle(Obstacle):
    """Configuration block of a plane; the half-space behind it is forbidden."""

    point: tuple[float, ...] = key("Point of the plane [m]")
    normal: tuple[float, ...] = key("Normal of the plane, pointing towards the robots")
    kind: str = key("Kind of surrounding", "plane", choices=("plane",))

    def body(self, name: str) -> Body:
        """Return the collision body."""
        point = _vector(join(name, "point"), self.point)
        normal = _vector(join(name, "normal"), self.normal)
        length = float(np.linalg.norm(normal))
        if length < 1e-9:
            raise ScenarioError(join(name, "normal"), list(self.normal), "3 numbers, not all zero")
        return Body(name, name, 0, Capsule(point, point + normal / length, 0.0), plane=True)

    def hull(self, name: str) -> Hull:
        """Return a thin plate in the plane, for drawing."""
        capsule = self.body(name).capsule
        normal = capsule.end - capsule.start
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).matrix()
        place = pin.SE3(turn, capsule.start - 0.5 * EXTENT[2] * normal)
        return hulls.box(np.array(EXTENT)).transformed(place)


@dataclass(frozen=True)
class MeshObstacle(Obstacle):
    """Configuration block of the convex hull of a mesh."""

    mesh: str = key("Mesh file, such as .stl or .dae")
    pose: tuple[float, ...] = key(
        "Pose of the mesh's frame: x y z [m], qx qy qz qw", IDENTITY_POSE
    )
    scale: float = key("Scale factor of the mesh's coordinates", 1.0, positive=True)
    kind: str = key("Kind of surrounding", "mesh", choices=("mesh",))

    def body(self, name: str) -> Body:
        """Return the collision body."""
        path = join(name, "mesh")
        if not Path(self.mesh).is_file():
            raise ScenarioError(path, f"no file {self.mesh!r}", "the file of a mesh")
        try:
            model = coal.MeshLoader().load(self.mesh, np.full(3, self.scale))
            points = hulls.convex_hull(np.array(model.vertices())).points
        except (ValueError, RuntimeError) as error:
            raise ScenarioError(
                path, f"{self.mesh!r} ({error})", "a mesh with a volume"
            ) from error
        return _convex(name, points, pose_from_list(join(name, "pose"), self.pose))


OBSTACLES: dict[str, type[Obstacle]] = {
    "sphere": SphereObstacle,
    "capsule": CapsuleObstacle,
    "box": BoxObstacle,
    "plane": PlaneObstacle,
    "mesh": MeshObstacle,
}


def _convex(name: str, corners: Array, pose: pin.SE3) -> Body:
    points = corners @ pose.rotation.T + pose.translation
    return Body(name, name, 0, capsule_around(points), convex_body(points))


def _vector(path: str, values: tuple[float, ...]) -> Array:
    if len(values) != 3:
        raise ScenarioError(path, list(values), "3 numbers")
    return np.array(values)
