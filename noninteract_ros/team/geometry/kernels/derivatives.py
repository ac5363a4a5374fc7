# SPDX-License-Identifier: Apache-2.0
"""Rates of distances: rows, and drifts at zero joint acceleration."""

from typing import NamedTuple

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.compiler import compiled, inner
from noninteract_ros.team.geometry.kernels.capsules import (
    CROSSED,
    PARALLEL,
    PLANE,
    SEGMENTS,
    TINY,
    Capsules,
    closest,
    distances,
    place,
)
from noninteract_ros.team.geometry.kernels.kinematics import (
    Indices,
    Motion,
    Tree,
    add_row,
    bias_of,
    move,
    velocity_of,
)
from noninteract_ros.team.geometry.kernels.vectors import along, at, cross, difference, dot, put


class Near(NamedTuple):
    """Terms of close pairs; see `clearance.Clearances`."""

    points: Array
    normals: Array
    rows: Array
    rates: Array
    drifts: Array


@inner
def _near(count: int, n: int) -> Near:
    return Near(
        np.empty((count, 2, 3)),
        np.empty((count, 3)),
        np.zeros((count, n)),
        np.empty(count),
        np.empty(count),
    )


@inner
def _segment_pair(
    tree: Tree, motion: Motion, capsules: Capsules, ends: Array, i: int, j: int, k: int, near: Near
) -> None:
    """Write row k for two capsules.

    With D = q + t d2 - p - s d1 between the closest points of the segments, n = D/|D| and w the
    relative velocity of the bodies' material points there, the rate is n'w. A parameter inside
    its segment keeps D perpendicular to it: d/dt (D'd) = 0 gives its rate. Then the drift is the
    rate of n'w, in which n rotates and the material points change.
    """
    a, b = capsules.joints[i], capsules.joints[j]
    p, q = at(ends[0], i), at(ends[0], j)
    d1, d2 = difference(at(ends[1], i), p), difference(at(ends[1], j), q)
    s, t = closest(p, d1, q, d2)
    p, q = along(p, s, d1), along(q, t, d2)
    D = difference(q, p)
    length = np.sqrt(dot(D, D))
    n = (0.0, 0.0, 1.0)
    if length > CROSSED:
        n = (D[0] / length, D[1] / length, D[2] / length)
    put(near.points[k], 0, along(p, capsules.radii[i], n))
    put(near.points[k], 1, along(q, -capsules.radii[j], n))
    put(near.normals, k, n)
    add_row(tree, motion, b, q, n, 1.0, near.rows[k])
    add_row(tree, motion, a, p, n, -1.0, near.rows[k])
    w = difference(velocity_of(motion, b, q, 0.0), velocity_of(motion, a, p, 0.0))
    turn1, turn2 = cross(at(motion.angular, a), d1), cross(at(motion.angular, b), d2)
    aa, bb, ab = dot(d1, d1), dot(d2, d2), dot(d1, d2)
    # Rates of s and t from (w + t' d2 - s' d1)'d_k + D'(omega_k x d_k) = 0.
    f1, f2 = dot(w, d1) + dot(D, turn1), dot(w, d2) + dot(D, turn2)
    free1, free2 = aa > TINY and 0.0 < s < 1.0, bb > TINY and 0.0 < t < 1.0
    s_rate, t_rate = 0.0, 0.0
    den = aa * bb - ab * ab
    if free1 and free2 and den > PARALLEL * aa * bb:
        s_rate, t_rate = (f1 * bb - f2 * ab) / den, (f1 * ab - f2 * aa) / den
    elif free1:
        s_rate = f1 / aa
    elif free2:
        t_rate = -f2 / bb
    change = along(along(w, t_rate, d2), -s_rate, d1)
    bias = difference(bias_of(motion, b, q), bias_of(motion, a, p))
    bias = along(along(bias, t_rate, turn2), -s_rate, turn1)
    near.rates[k], near.drifts[k] = dot(n, w), dot(n, bias)
    if length > CROSSED:
        near.drifts[k] += (dot(change, w) - dot(n, change) * dot(n, w)) / length


@inner
def _plane_pair(
    tree: Tree, motion: Motion, capsules: Capsules, ends: Array, i: int, j: int, k: int, near: Near
) -> None:
    """Write row k for a capsule and a plane, which does not move."""
    a, n = capsules.joints[i], at(ends[1], j)
    p, end = at(ends[0], i), at(ends[1], i)
    if dot(n, end) < dot(n, p):
        p = end
    put(near.points[k], 0, along(p, -capsules.radii[i], n))
    put(near.points[k], 1, along(p, -dot(n, difference(p, at(ends[0], j))), n))
    put(near.normals, k, (-n[0], -n[1], -n[2]))
    add_row(tree, motion, a, p, n, 1.0, near.rows[k])
    near.rates[k] = dot(n, velocity_of(motion, a, p, 0.0))
    near.drifts[k] = dot(n, bias_of(motion, a, p))


@compiled
def sampled(tree: Tree, capsules: Capsules, pairs: Indices, samples: Array) -> Array:
    """Distances of pairs of capsules at joint positions, shape (s, n), as shape (s, m)."""
    kinds, still = np.full(len(pairs), SEGMENTS), np.zeros(samples.shape[1])
    found = np.empty((len(samples), len(pairs)))
    for k in range(len(samples)):
        motion = move(tree, samples[k], still)
        found[k] = distances(capsules, place(motion, capsules), pairs, kinds, np.inf)
    return found


@inner
def _fastest(motion: Motion, capsules: Capsules, ends: Array) -> float:
    """Largest speed of an end of a segment [m/s]."""
    found = 0.0
    for b in range(len(capsules.joints)):
        for side in range(2):
            if capsules.joints[b] > 0:
                w = velocity_of(motion, capsules.joints[b], at(ends[side], b), 0.0)
                found = max(found, np.sqrt(dot(w, w)))
    return found


@compiled
def survey(
    tree: Tree,
    capsules: Capsules,
    pairs: Indices,
    kinds: Indices,
    positions: Array,
    v: Array,
    reach: float,
    horizon: float,
) -> tuple[Motion, Array, Indices, Near, float]:
    """Motion, all distances, pairs below the reach and their terms, which convex ones lack.

    The reach grows by what two bodies can come closer within the horizon [s]; it is returned.
    """
    motion = move(tree, positions, v)
    ends = place(motion, capsules)
    if horizon > 0.0:
        reach += 2.0 * horizon * _fastest(motion, capsules, ends)
    found = distances(capsules, ends, pairs, kinds, reach)
    chosen = np.flatnonzero(found < reach)
    near = _near(len(chosen), len(v))
    for k in range(len(chosen)):
        i, j = pairs[chosen[k], 0], pairs[chosen[k], 1]
        if kinds[chosen[k]] == SEGMENTS:
            _segment_pair(tree, motion, capsules, ends, i, j, k, near)
        elif kinds[chosen[k]] == PLANE:
            _plane_pair(tree, motion, capsules, ends, i, j, k, near)
    return motion, found, chosen, near, reach


@compiled
def contact_terms(
    tree: Tree, motion: Motion, joints: Indices, now: Array, later: Array, ahead: float, near: Near
) -> None:
    """Write the rows of convex pairs; the drift is a finite difference of rates.

    Args:
        tree: Joints.
        motion: Motion of the joints.
        joints: Joints of both bodies of each pair, shape (k, 2).
        now: Normal and nearest points of each pair, shape (k, 3, 3).
        later: Normal and nearest points `ahead` [s] later, shape (k, 3, 3).
        ahead: Step of the finite difference [s].
        near: Output: terms of the pairs.
    """
    for k in range(len(joints)):
        a, b = joints[k, 0], joints[k, 1]
        n, p, q = at(now[k], 0), at(now[k], 1), at(now[k], 2)
        put(near.points[k], 0, p)
        put(near.points[k], 1, q)
        put(near.normals, k, n)
        add_row(tree, motion, b, q, n, 1.0, near.rows[k])
        add_row(tree, motion, a, p, n, -1.0, near.rows[k])
        w = difference(velocity_of(motion, b, q, 0.0), velocity_of(motion, a, p, 0.0))
        near.rates[k] = dot(n, w)
        n, p, q = at(later[k], 0), at(later[k], 1), at(later[k], 2)
        w = difference(velocity_of(motion, b, q, ahead), velocity_of(motion, a, p, ahead))
        near.drifts[k] = (dot(n, w) - near.rates[k]) / ahead
