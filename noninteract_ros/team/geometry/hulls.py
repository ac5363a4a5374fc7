# SPDX-License-Identifier: Apache-2.0
"""Convex bodies as triangles, to be drawn."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from noninteract_ros.arrays import Array

CORNERS = 120  # of a hull at most; a picture does not show more
AROUND = 20  # corners of a circle
EDGE = 0.75  # cosine of the angle from which on two faces meet in an edge that can be seen


@dataclass(frozen=True)
class Hull:
    """A convex body as triangles, counterclockwise from outside.

    Attributes:
        points: Its corners, shape (m, 3) [m].
        corners: Those of each triangle, shape (k, 3, 3) [m].
        normals: Direction of the surface at each, as light sees it, shape (k, 3, 3).
    """

    points: Array
    corners: Array
    normals: Array

    def transformed(self, placement: pin.SE3) -> "Hull":
        """The same in another frame: x -> R x + p."""
        turn, shift = placement.rotation.T, placement.translation
        return Hull(self.points @ turn + shift, self.corners @ turn + shift, self.normals @ turn)

    def refined(self, longest: float) -> "Hull":
        """The same in triangles with edges no longer than this [m].

        Small ones can be sorted by their distance from the eye.
        """
        waiting = np.concatenate((self.corners, self.normals), axis=2)
        small: list[Array] = []
        while len(waiting):
            corners = waiting[:, :, :3]
            edges = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
            large = edges.max(axis=1) > longest
            small.append(waiting[~large])
            waiting = _halved(waiting[large], edges[large].argmax(axis=1))
        joined = np.concatenate(small)
        return Hull(self.points, joined[:, :, :3], joined[:, :, 3:])


def _halved(corners: Array, longest: NDArray[np.intp]) -> Array:
    """Each triangle as two, cut through its longest edge; (k, 3, c) to (2 k, 3, c)."""
    rows = np.arange(len(corners))
    a, b, c = (corners[rows, (longest + step) % 3] for step in range(3))
    middle = 0.5 * (a + b)
    return np.concatenate((np.stack((a, middle, c), axis=1), np.stack((middle, b, c), axis=1)))


def convex_hull(points: Array) -> Hull:
    """Convex hull of points (m, 3), of those alone that stand out where they are many.

    Raises:
        scipy.spatial.QhullError: They lie in one plane.
    """
    if len(points) > CORNERS:
        points = points[np.unique((points @ sphere_points(CORNERS).T).argmax(axis=0))]
    found = ConvexHull(points)
    faces, flat = np.array(found.simplices), found.equations[:, :3]
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    across = np.cross(b - a, c - a)
    inward = (across * flat).sum(axis=1) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    areas = np.linalg.norm(across, axis=1)
    return Hull(points[found.vertices], points[faces], _normals(faces, flat, areas))


def _normals(faces: NDArray[np.intp], flat: Array, areas: Array) -> Array:
    """Normals at the corners of faces: means of those around that do not differ by an edge."""
    normals = np.empty((*faces.shape, 3))
    smooth = flat @ flat.T > EDGE
    for corner in range(3):
        shares = (faces == faces[:, corner, None, None]).any(axis=2) & smooth
        mean = (shares * areas) @ flat
        normals[:, corner] = mean / np.linalg.norm(mean, axis=1, keepdims=True)
    return normals


def sphere_points(count: int) -> Array:
    """Points spread evenly over the unit sphere (Fibonacci's spiral), shape (count, 3)."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    radius = np.sqrt(1.0 - z**2)
    return np.stack((radius * np.cos(angle), radius * np.sin(angle), z), axis=1)


def sphere(radius: float, count: int = 60) -> Hull:
    """A ball about the origin [m]."""
    return convex_hull(radius * sphere_points(count))


def box(size: Array) -> Hull:
    """A box about the origin, edges along the axes, of a size (3,) [m]."""
    signs = np.array(np.meshgrid((-0.5, 0.5), (-0.5, 0.5), (-0.5, 0.5))).reshape(3, 8).T
    return convex_hull(signs * size)


def cylinder(radius: float, length: float) -> Hull:
    """A cylinder about the origin, along z [m]."""
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
    circle = radius * np.stack((np.cos(angle), np.sin(angle)), axis=1)
    ends = [np.column_stack((circle, np.full(AROUND, z))) for z in (-length / 2, length / 2)]
    return convex_hull(np.concatenate(ends))


def capsule(start: Array, end: Array, radius: float) -> Hull:
    """All that is no farther than a radius from the line between two points [m]."""
    around = radius * sphere_points(CORNERS // 2)
    return convex_hull(np.concatenate((start + around, end + around)))


def geometry_hull(geometry: Any) -> Hull | None:
    """Hull of a collision geometry of coal; None for a kind that has no size."""
    kind = type(geometry).__name__
    if hasattr(geometry, "vertices"):
        return convex_hull(np.asarray(geometry.vertices()))
    if kind == "Box":
        return box(2.0 * np.asarray(geometry.halfSide))
    if kind == "Sphere":
        return sphere(geometry.radius)
    if kind == "Cylinder":
        return cylinder(geometry.radius, 2.0 * geometry.halfLength)
    if kind == "Capsule":
        end = np.array([0.0, 0.0, geometry.halfLength])
        return capsule(-end, end, geometry.radius)
    return None
