# SPDX-License-Identifier: Apache-2.0
"""Distances between capsules, and from capsules to planes."""

from typing import NamedTuple

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.compiler import compiled, inner
from noninteract_ros.team.geometry.kernels.kinematics import Indices, Motion
from noninteract_ros.team.geometry.kernels.vectors import (
    Vector,
    added,
    along,
    at,
    difference,
    dot,
    put,
    turned,
)

SEGMENTS, PLANE, CONVEX = 0, 1, 2  # kinds of pairs
TINY = 1e-12  # [m^2] squared length below which a segment is a point
CROSSED = 1e-9  # [m] distance below which segments intersect and have no normal
PARALLEL = 1e-9  # squared sine of the angle below which two segments are parallel


class Capsules(NamedTuple):
    """Bodies as segments with a radius, each fixed to a joint.

    Attributes:
        joints: Joint of each body, shape (b,).
        starts: Start of each segment in the joint's frame, shape (b, 3) [m]; a point of a plane.
        ends: End of each segment, shape (b, 3) [m]; for a plane, its unit normal.
        radii: Radius of each body, shape (b,) [m]; negative for a plane.
    """

    joints: Indices
    starts: Array
    ends: Array
    radii: Array


@compiled
def place(motion: Motion, capsules: Capsules) -> Array:
    """Return starts and ends of all segments in the world, shape (2, b, 3); normals for planes."""
    count = len(capsules.joints)
    out = np.empty((2, count, 3))
    for b in range(count):
        j = capsules.joints[b]
        origin = at(motion.origins, j)
        put(out[0], b, added(origin, turned(motion.rotations, j, at(capsules.starts, b))))
        end = turned(motion.rotations, j, at(capsules.ends, b))
        put(out[1], b, end if capsules.radii[b] < 0.0 else added(origin, end))
    return out


@inner
def closest(p: Vector, d1: Vector, q: Vector, d2: Vector) -> tuple[float, float]:
    """Return the parameters s, t in [0, 1] of the closest points p + s d1 and q + t d2."""
    r = difference(p, q)
    a, e, b = dot(d1, d1), dot(d2, d2), dot(d1, d2)
    c, f = dot(d1, r), dot(d2, r)
    den = a * e - b * b
    s = 0.0
    if a > TINY:
        s = 0.5
        if e > TINY and den > PARALLEL * a * e:
            s = min(1.0, max(0.0, (b * f - c * e) / den))
        elif e <= TINY:
            s = min(1.0, max(0.0, -c / a))
    t = (b * s + f) / e if e > TINY else 0.0
    if t < 0.0 or t > 1.0:
        t = min(1.0, max(0.0, t))
        s = min(1.0, max(0.0, (b * t - c) / a)) if a > TINY else 0.0
    return s, t


@compiled
def distances(
    capsules: Capsules, ends: Array, pairs: Indices, kinds: Indices, reach: float
) -> Array:
    """Return the distance of each pair, shape (m,) [m]; a lower bound if it exceeds `reach`."""
    out = np.empty(len(pairs))
    for k in range(len(pairs)):
        i, j = pairs[k, 0], pairs[k, 1]
        p, q = at(ends[0], i), at(ends[0], j)
        if kinds[k] == PLANE:
            n = at(ends[1], j)
            low = min(dot(n, difference(p, q)), dot(n, difference(at(ends[1], i), q)))
            out[k] = low - capsules.radii[i]
            continue
        d1, d2 = difference(at(ends[1], i), p), difference(at(ends[1], j), q)
        radii = capsules.radii[i] + capsules.radii[j]
        middle = difference(along(q, 0.5, d2), along(p, 0.5, d1))
        halves = 0.5 * (np.sqrt(dot(d1, d1)) + np.sqrt(dot(d2, d2)))
        out[k] = np.sqrt(dot(middle, middle)) - halves - radii
        if out[k] <= reach:
            s, t = closest(p, d1, q, d2)
            between = difference(along(q, t, d2), along(p, s, d1))
            out[k] = np.sqrt(dot(between, between)) - radii
    return out
