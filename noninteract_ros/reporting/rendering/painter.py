# SPDX-License-Identifier: Apache-2.0
"""Painter's algorithm for convex bodies, with a perspective camera and a directional light."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection, TriMesh
from matplotlib.colors import to_rgb
from matplotlib.tri import Triangulation
from scipy.spatial import ConvexHull, QhullError

from noninteract_ros.arrays import Array
from noninteract_ros.team.geometry.hulls import Hull

DISTANCE = 4.5  # of the camera from the centre, in radii of the scene
LIGHT = np.array([-0.35, -0.45, 0.82]) / np.linalg.norm([-0.35, -0.45, 0.82])
AMBIENT = 0.5
SHADOW = "#DADADA"


@dataclass(frozen=True)
class Camera:
    """Perspective camera.

    Attributes:
        centre: Point in the centre of the image, shape (3,) [m].
        eye: Position of the camera, shape (3,) [m].
        axes: Right, up and backward directions as rows, shape (3, 3).
    """

    centre: Array
    eye: Array
    axes: Array

    @classmethod
    def towards(cls, centre: Array, radius: float, azimuth: float, elevation: float) -> "Camera":
        """Create a camera that views a sphere about centre (3,) [m] from two angles [degrees]."""
        a, b = np.radians(azimuth), np.radians(elevation)
        back = np.array([np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        axes = np.stack((right, np.cross(back, right), back))
        return cls(centre, centre + DISTANCE * radius * back, axes)

    def project(self, points: Array) -> Array:
        """Project points (..., 3) into the image, shape (..., 2) [m at the centre's distance]."""
        local = (points - self.eye) @ self.axes.T
        distance = float(np.linalg.norm(self.eye - self.centre))
        image: Array = local[..., :2] * (distance / -local[..., 2:])
        return image


def paint(axes: Axes, camera: Camera, bodies: Sequence[tuple[str, Hull]]) -> None:
    """Draw bodies in given colours as shaded triangles, farthest first."""
    corners = np.concatenate([hull.corners for _, hull in bodies])
    normals = np.concatenate([hull.normals for _, hull in bodies])
    counts = [len(hull.corners) for _, hull in bodies]
    colours = np.repeat([to_rgb(colour) for colour, _ in bodies], counts, axis=0)
    a, b, c = (corners[:, corner] for corner in range(3))
    middle = corners.mean(axis=1)
    visible = (np.cross(b - a, c - a) * (camera.eye - middle)).sum(axis=1) > 0.0
    distance = np.linalg.norm(middle - camera.eye, axis=1)
    order = np.flatnonzero(visible)[np.argsort(-distance[visible])]
    light = AMBIENT + (1.0 - AMBIENT) * np.clip(normals[order] @ LIGHT, 0.0, 1.0)
    shaded = np.ones((len(order), 3, 4))
    shaded[:, :, :3] = colours[order][:, None] * light[:, :, None]
    x, y = camera.project(corners[order]).reshape(-1, 2).T
    triangles = Triangulation(x, y, np.arange(len(x)).reshape(-1, 3))
    axes.add_collection(
        TriMesh(triangles, facecolors=shaded.reshape(-1, 4), zorder=3.0), autolim=False
    )


def outlines(axes: Axes, camera: Camera, bodies: Sequence[tuple[str, Hull]]) -> None:
    """Draw bodies as ghosts: transparent silhouettes behind all solid bodies."""
    axes.add_collection(
        PolyCollection(
            [_silhouette(camera.project(hull.points)) for _, hull in bodies],
            facecolors=[(*to_rgb(colour), 0.12) for colour, _ in bodies],
            edgecolors=[(*to_rgb(colour), 0.55) for colour, _ in bodies],
            linewidths=0.6,
            zorder=2.0,
        ),
        autolim=False,
    )


def shadows(axes: Axes, camera: Camera, bodies: Sequence[tuple[str, Hull]], ground: float) -> None:
    """Draw the shadows of bodies on a horizontal plane at a height [m]."""
    polygons = []
    for _, hull in bodies:
        height = hull.points[:, 2:] - ground
        shadow = hull.points - height * LIGHT / LIGHT[2]
        polygons.append(_silhouette(camera.project(shadow)))
    axes.add_collection(PolyCollection(polygons, facecolors=SHADOW, zorder=1.0), autolim=False)


def _silhouette(points: Array) -> Array:
    """Return the convex hull of points in the plane (m, 2); collinear points unchanged."""
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:
        return points
