# SPDX-License-Identifier: Apache-2.0
"""Fitting of capsules around convex bodies."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.optimize import minimize

from noninteract_ros.arrays import Array


@dataclass(frozen=True)
class Capsule:
    """Set of all points within a radius of a segment.

    Attributes:
        start: Start of the segment, shape (3,) [m].
        end: End of the segment, shape (3,) [m].
        radius: Radius [m].
    """

    start: Array
    end: Array
    radius: float

    @property
    def volume(self) -> float:
        """Volume [m^3]."""
        length = float(np.linalg.norm(self.end - self.start))
        return float(np.pi * self.radius**2 * (length + 4.0 / 3.0 * self.radius))


def capsule_around(points: Array) -> Capsule:
    """Return a small capsule that contains points, shape (m, 3) [m].

    Direction and centre line are optimised from the principal axes. The capsule contains all
    points, whether or not the optimisation converges.
    """
    return _fitted(points.tobytes())  # Robots of one model have the same links.


@cache
def _fitted(points: bytes) -> Capsule:
    cloud = np.frombuffer(points).reshape(-1, 3)
    centre = cloud.mean(axis=0)
    axes = np.linalg.svd(cloud - centre)[2]
    found = [_searched(cloud, centre, np.roll(axes, -first, axis=0)) for first in range(3)]
    return min(found, key=lambda capsule: capsule.volume)


def _searched(cloud: Array, centre: Array, frame: Array) -> Capsule:
    """Return the smallest capsule found from the direction frame[0]."""
    local = (cloud - centre) @ frame.T
    size = np.ptp(local, axis=0)
    x0 = np.concatenate([np.zeros(2), 0.5 * (local.min(axis=0) + local.max(axis=0))[1:]])
    steps = np.diag(np.concatenate([[0.1, 0.1], 0.1 * size[1:] + 1e-3]))
    options = {"maxiter": 150, "xatol": 1e-4, "fatol": 1e-9}
    found = minimize(
        lambda x: _built(cloud, centre, frame, x).volume,
        x0,
        method="Nelder-Mead",
        options={**options, "initial_simplex": np.vstack([x0, x0 + steps])},
    )
    return _built(cloud, centre, frame, found.x)


def _built(points: Array, centre: Array, frame: Array, x: Array) -> Capsule:
    """Return the capsule along frame[0] + x[0] frame[1] + x[1] frame[2], shifted by x[2:]."""
    axis = frame[0] + x[0] * frame[1] + x[1] * frame[2]
    axis = axis / np.linalg.norm(axis)
    base = centre + x[2] * frame[1] + x[3] * frame[2]
    along = (points - base) @ axis
    across = np.linalg.norm(points - base - np.outer(along, axis), axis=1)
    radius = float(across.max())
    inside = np.sqrt(np.maximum(radius**2 - across**2, 0.0))
    low, high = float((along + inside).min()), float((along - inside).max())
    if low > high:  # Both ends coincide: a sphere.
        low = high = 0.5 * (low + high)
    return Capsule(base + low * axis, base + high * axis, radius)
