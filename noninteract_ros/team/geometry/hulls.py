# SPDX-License-Identifier: Apache-2.0
"""Triangle meshes of convex bodies, for drawing."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from noninteract_ros.arrays import Array

MAX_CORNERS = 120  # of a hull; more are not visible in a picture
CIRCLE_CORNERS = 20
SHARP_EDGE = 0.75  # largest cosine between the normals of two faces that meet in a visible edge


@dataclass(frozen=True)
class Hull:
    """Triangle mesh of a convex body, counterclockwise seen from outside.

    Attributes:
        points: Vertices of the body, shape (m, 3) [m].
        corners: Vertices of each triangle, shape (k, 3, 3) [m].
        normals: Shading normal at each corner, shape (k, 3, 3).
    """

    points: Array
    corners: Array
    normals: Array

    def transformed(self, placement: pin.SE3) -> "Hull":
        """Return the hull in another frame: x -> R x + p."""
        turn, shift = placement.rotation.T, placement.translation
        return Hull(self.points @ turn + shift, self.corners @ turn + shift, self.normals @ turn)

    def refined(self, longest: float) -> "Hull":
        """Return the hull split into triangles with edges no longer than `longest` [m].

        Small triangles can be sorted by their distance from the camera.
        """
        pending = np.concatenate((self.corners, self.normals), axis=2)
        small: list[Array] = []
        while len(pending):
            corners = pending[:, :, :3]
            edges = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
            large = edges.max(axis=1) > longest
            small.append(pending[~large])
            pending = _halved(pending[large], edges[large].argmax(axis=1))
        joined = np.concatenate(small)
        return Hull(self.points, joined[:, :, :3], joined[:, :, 3:])


def _halved(corners: Array, longest: NDArray[np.intp]) -> Array:
    """Split each triangle at the middle of its longest edge; (k, 3, c) to (2 k, 3, c)."""
    rows = np.arange(len(corners))
    a, b, c = (corners[rows, (longest + step) % 3] for step in range(3))
    middle = 0.5 * (a + b)
    return np.concatenate((np.stack((a, middle, c), axis=1), np.stack((middle, b, c), axis=1)))


def convex_hull(points: Array) -> Hull:
    """Return the convex hull of points, shape (m, 3), with at most `MAX_CORNERS` vertices.

    Raises:
        scipy.spatial.QhullError: The points lie in one plane.
    """
    if len(points) > MAX_CORNERS:
        points = points[np.unique((points @ sphere_points(MAX_CORNERS).T).argmax(axis=0))]
    found = ConvexHull(points)
    faces, flat = np.array(found.simplices), found.equations[:, :3]
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    across = np.cross(b - a, c - a)
    inward = (across * flat).sum(axis=1) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    areas = np.linalg.norm(across, axis=1)
    return Hull(points[found.vertices], points[faces], _normals(faces, flat, areas))


def _normals(faces: NDArray[np.intp], flat: Array, areas: Array) -> Array:
    """Return shading normals: area-weighted means of adjacent faces without a sharp edge."""
    normals = np.empty((*faces.shape, 3))
    smooth = flat @ flat.T > SHARP_EDGE
    for corner in range(3):
        shares = (faces == faces[:, corner, None, None]).any(axis=2) & smooth
        mean = (shares * areas) @ flat
        normals[:, corner] = mean / np.linalg.norm(mean, axis=1, keepdims=True)
    return normals


def sphere_points(count: int) -> Array:
    """Return evenly distributed points on the unit sphere (Fibonacci spiral), shape (count, 3)."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    radius = np.sqrt(1.0 - z**2)
    return np.stack((radius * np.cos(angle), radius * np.sin(angle), z), axis=1)


def sphere(radius: float, count: int = 60) -> Hull:
    """Return a sphere about the origin [m], approximated by `count` vertices."""
    return convex_hull(radius * sphere_points(count))


def box(size: Array) -> Hull:
    """Return an axis-aligned box about the origin, with a size of shape (3,) [m]."""
    signs = np.array(np.meshgrid((-0.5, 0.5), (-0.5, 0.5), (-0.5, 0.5))).reshape(3, 8).T
    return convex_hull(signs * size)


def cylinder(radius: float, length: float) -> Hull:
    """Return a cylinder about the origin, along z [m]."""
    angle = 2.0 * np.pi * np.arange(CIRCLE_CORNERS) / CIRCLE_CORNERS
    circle = radius * np.stack((np.cos(angle), np.sin(angle)), axis=1)
    ends = [
        np.column_stack((circle, np.full(CIRCLE_CORNERS, z))) for z in (-length / 2, length / 2)
    ]
    return convex_hull(np.concatenate(ends))


def capsule(start: Array, end: Array, radius: float) -> Hull:
    """Return the capsule of a radius about the line segment between two points [m]."""
    around = radius * sphere_points(MAX_CORNERS // 2)
    return convex_hull(np.concatenate((start + around, end + around)))


def geometry_hull(geometry: Any) -> Hull | None:
    """Return the hull of a coal collision geometry; None for an unbounded or unknown kind."""
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
