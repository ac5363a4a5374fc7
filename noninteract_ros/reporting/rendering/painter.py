# SPDX-License-Identifier: Apache-2.0
"""A camera and a light: convex bodies onto a plane, the farthest first."""

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

DISTANCE = 4.5  # of the eye from what it sees, in radii of it
SUN = np.array([-0.35, -0.45, 0.82]) / np.linalg.norm([-0.35, -0.45, 0.82])
AMBIENT = 0.5
SHADOW = "#DADADA"


@dataclass(frozen=True)
class Camera:
    """A perspective camera.

    Attributes:
        centre: What it looks at, shape (3,) [m].
        eye: Where it is, shape (3,) [m].
        axes: Directions to the right, up and towards the eye as rows, shape (3, 3).
    """

    centre: Array
    eye: Array
    axes: Array

    @classmethod
    def towards(cls, centre: Array, radius: float, azimuth: float, elevation: float) -> "Camera":
        """A camera that sees a ball (3,) [m] from a direction given by two angles [degrees]."""
        a, b = np.radians(azimuth), np.radians(elevation)
        back = np.array([np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        axes = np.stack((right, np.cross(back, right), back))
        return cls(centre, centre + DISTANCE * radius * back, axes)

    def project(self, points: Array) -> Array:
        """Points (..., 3) in the picture, shape (..., 2) [m at the centre's distance]."""
        seen = (points - self.eye) @ self.axes.T
        distance = float(np.linalg.norm(self.eye - self.centre))
        flat: Array = seen[..., :2] * (distance / -seen[..., 2:])
        return flat


def paint(axes: Axes, camera: Camera, bodies: Sequence[tuple[str, Hull]]) -> None:
    """Draws bodies of given colours: shaded triangles, the farthest first."""
    corners = np.concatenate([hull.corners for _, hull in bodies])
    normals = np.concatenate([hull.normals for _, hull in bodies])
    counts = [len(hull.corners) for _, hull in bodies]
    colours = np.repeat([to_rgb(colour) for colour, _ in bodies], counts, axis=0)
    a, b, c = (corners[:, corner] for corner in range(3))
    middle = corners.mean(axis=1)
    seen = (np.cross(b - a, c - a) * (camera.eye - middle)).sum(axis=1) > 0.0
    distance = np.linalg.norm(middle - camera.eye, axis=1)
    order = np.flatnonzero(seen)[np.argsort(-distance[seen])]
    light = AMBIENT + (1.0 - AMBIENT) * np.clip(normals[order] @ SUN, 0.0, 1.0)
    shaded = np.ones((len(order), 3, 4))
    shaded[:, :, :3] = colours[order][:, None] * light[:, :, None]
    x, y = camera.project(corners[order]).reshape(-1, 2).T
    triangles = Triangulation(x, y, np.arange(len(x)).reshape(-1, 3))
    axes.add_collection(
        TriMesh(triangles, facecolors=shaded.reshape(-1, 4), zorder=3.0), autolim=False
    )


def outlines(axes: Axes, camera: Camera, bodies: Sequence[tuple[str, Hull]]) -> None:
    """Draws bodies as ghosts: their silhouettes, transparent, behind everything solid."""
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
    """Draws what bodies keep from a horizontal plane at a height [m] when the sun shines."""
    polygons = []
    for _, hull in bodies:
        height = hull.points[:, 2:] - ground
        fallen = hull.points - height * SUN / SUN[2]
        polygons.append(_silhouette(camera.project(fallen)))
    axes.add_collection(PolyCollection(polygons, facecolors=SHADOW, zorder=1.0), autolim=False)


def _silhouette(points: Array) -> Array:
    """Convex hull of points in the plane (m, 2); themselves where they lie on a line."""
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:
        return points
