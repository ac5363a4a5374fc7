# SPDX-License-Identifier: Apache-2.0
"""Motion of joint frames and of points fixed to them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.compiler import compiled, inner
from noninteract_ros.team.geometry.kernels.vectors import (
    Vector,
    added,
    along,
    at,
    cross,
    difference,
    dot,
    put,
    turned,
)

Indices = NDArray[np.int64]


class Tree(NamedTuple):
    """Joints of a team, each of one degree of freedom; joint 0 is the world.

    Attributes:
        parents: Parent of each joint, shape (j,).
        rotations: Orientation of each joint in its parent, shape (j, 3, 3).
        translations: Position of each joint in its parent, shape (j, 3) [m].
        axes: Axis of each joint in its own frame, unit vectors, shape (j, 3).
        sliding: True for prismatic joints, shape (j,).
        columns: Index of each joint in a velocity; -1 for the world, shape (j,).
    """

    parents: Indices
    rotations: Array
    translations: Array
    axes: Array
    sliding: NDArray[np.bool_]
    columns: Indices


class Motion(NamedTuple):
    """Motion of all joint frames in world axes, at zero joint acceleration.

    Attributes:
        rotations: Orientations, shape (j, 3, 3).
        origins: Positions, shape (j, 3) [m].
        axes: Joint axes, shape (j, 3).
        angular: Angular velocities, shape (j, 3) [rad/s].
        linear: Velocities of the origins, shape (j, 3) [m/s].
        angular_bias: Angular accelerations, shape (j, 3) [rad/s^2].
        linear_bias: Accelerations of the origins, shape (j, 3) [m/s^2].
    """

    rotations: Array
    origins: Array
    axes: Array
    angular: Array
    linear: Array
    angular_bias: Array
    linear_bias: Array


@inner
def _put_rotation(tree: Tree, rotations: Array, j: int, angle: float) -> None:
    """Write the rotation of a joint from its parent, its placement and Rodrigues' formula."""
    p, a = tree.parents[j], at(tree.axes, j)
    c, s = np.cos(angle), np.sin(angle)
    for column in range(3):
        e = (0.0 + (column == 0), 0.0 + (column == 1), 0.0 + (column == 2))
        x = along(along((0.0, 0.0, 0.0), c, e), s, cross(a, e))
        x = along(x, (1.0 - c) * a[column], a)
        x = turned(rotations, p, turned(tree.rotations, j, x))
        for row in range(3):
            rotations[j, row, column] = x[row]


@compiled
def move(tree: Tree, positions: Array, v: Array) -> Motion:
    """Return the motion of all joint frames at positions and velocities, shape (n,) each."""
    count = len(tree.parents)
    vectors, rotations = np.zeros((6, count, 3)), np.zeros((count, 3, 3))
    axes, origins, angular = vectors[0], vectors[1], vectors[2]
    linear, angular_bias, linear_bias = vectors[3], vectors[4], vectors[5]
    for i in range(3):
        rotations[0, i, i] = 1.0
    for j in range(1, count):
        p, c, slides = tree.parents[j], tree.columns[j], tree.sliding[j]
        _put_rotation(tree, rotations, j, 0.0 if slides else positions[c])
        r = turned(rotations, p, at(tree.translations, j))
        axis = turned(rotations, j, at(tree.axes, j))
        if slides:
            r = along(r, positions[c], axis)
        w, al = at(angular, p), at(angular_bias, p)
        wr, turning = cross(w, r), cross(w, axis)
        speed = added(at(linear, p), wr)
        bias = added(at(linear_bias, p), added(cross(al, r), cross(w, wr)))
        if slides:
            speed, bias = along(speed, v[c], axis), along(bias, 2.0 * v[c], turning)
        else:
            w, al = along(w, v[c], axis), along(al, v[c], turning)
        put(axes, j, axis)
        put(origins, j, added(at(origins, p), r))
        put(angular, j, w)
        put(linear, j, speed)
        put(angular_bias, j, al)
        put(linear_bias, j, bias)
    return Motion(rotations, origins, axes, angular, linear, angular_bias, linear_bias)


@inner
def velocity_of(motion: Motion, j: int, p: Vector, ahead: float) -> Vector:
    """Return the velocity of a body's point, `ahead` [s] later at zero joint acceleration."""
    w = along(at(motion.angular, j), ahead, at(motion.angular_bias, j))
    v = along(at(motion.linear, j), ahead, at(motion.linear_bias, j))
    origin = along(at(motion.origins, j), ahead, at(motion.linear, j))
    origin = along(origin, 0.5 * ahead * ahead, at(motion.linear_bias, j))
    return added(v, cross(w, difference(p, origin)))


@inner
def bias_of(motion: Motion, j: int, p: Vector) -> Vector:
    """Return the acceleration of a body's point at zero joint acceleration."""
    r, w = difference(p, at(motion.origins, j)), at(motion.angular, j)
    turning = added(cross(at(motion.angular_bias, j), r), cross(w, cross(w, r)))
    return added(at(motion.linear_bias, j), turning)


@inner
def add_row(
    tree: Tree, motion: Motion, j: int, p: Vector, n: Vector, sign: float, row: Array
) -> None:
    """Add sign n' J of a body's point to a row, shape (n,)."""
    while j > 0:
        c, axis = tree.columns[j], at(motion.axes, j)
        if tree.sliding[j]:
            row[c] += sign * dot(n, axis)
        else:
            lever = difference(p, at(motion.origins, j))
            row[c] += sign * dot(n, cross(axis, lever))
        j = tree.parents[j]
