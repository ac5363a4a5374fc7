# SPDX-License-Identifier: Apache-2.0
"""Mean of the tools' orientations and its angular velocity, see `TeamRotation`."""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.compiler import FIRST, inner
from noninteract_ros.control.fast.kernels import rotations
from noninteract_ros.control.fast.kernels.array_parts import MixingArrays
from noninteract_ros.control.fast.kernels.blocks import add_product, invert, product
from noninteract_ros.control.fast.kernels.robots import Poses

ROUNDING = 1e-14
ITERATIONS = 20


@inner
def mean_rotation(weights: Array, orientations: Array, phis: Array) -> rotations.Quaternion:
    """Return the mean of the tools' orientations, by Newton's method.

    Args:
        weights: Weight of each tool, with sum 1, shape (N,).
        orientations: Tool orientations, shape (N, 3, 3).
        phis: Output: rotation vectors from the mean to the tools, shape (N, 3).
    """
    N = len(weights)
    tools = np.empty((N, 4))
    for k in range(N):
        rotations.put_quaternion(rotations.of_matrix(orientations, k), tools, k, FIRST)
    mean = _first_guess(weights, tools)
    A, B_inverse, work = np.empty((1, 3, 3)), np.empty((1, 3, 3)), np.empty((1, 3, 3))
    for _ in range(ITERATIONS):
        x, y, z = 0.0, 0.0, 0.0
        B = np.zeros((1, 3, 3))
        for k in range(N):
            tool = rotations.quaternion_at(tools, k, 0)
            phi = rotations.log(rotations.product(tool, rotations.inverse(mean)))
            x += weights[k] * phi[0]
            y += weights[k] * phi[1]
            z += weights[k] * phi[2]
            rotations.put_inverse_jacobian(phi, A, FIRST)
            for i in range(3):
                phis[k, i] = phi[i]
                for j in range(3):
                    B[0, i, j] += weights[k] * A[0, j, i]
        if max(abs(x), abs(y), abs(z)) < ROUNDING:
            break
        invert(B, FIRST, work, B_inverse, FIRST)
        change = rotations.exp(rotations.times(B_inverse, FIRST, (x, y, z)))
        mean = rotations.normalized(rotations.product(change, mean))
    return mean


@inner
def _first_guess(weights: Array, tools: Array) -> rotations.Quaternion:
    """Return the weighted sum of the quaternions, with signs closest to the heaviest one.

    Tools within a quarter turn of their mean are within a half turn of each other.
    """
    first = 0
    for k in range(len(weights)):
        first = k if weights[k] > weights[first] else first
    x, y, z, w = 0.0, 0.0, 0.0, 0.0
    for k in range(len(weights)):
        along = 0.0
        for i in range(4):
            along += tools[k, i] * tools[first, i]
        weight = weights[k] if along >= 0.0 else -weights[k]
        x, y = x + weight * tools[k, 0], y + weight * tools[k, 1]
        z, w = z + weight * tools[k, 2], w + weight * tools[k, 3]
    return rotations.normalized((x, y, z, w))


@inner
def put_turning(
    A: MixingArrays, a: int, weights: Array, phis: Array, poses: Poses
) -> rotations.Vector:
    """Write G of the rotations and its rate; return the mean's angular velocity.

    With A_k = A(phi_k)^-1 and B = sum of w_k A_k', G_k = w_k B^-1 A_k R_k.
    """
    N = len(weights)
    jacobians, B_inverse = np.empty((N, 3, 3)), np.empty((1, 3, 3))
    B, B_rate, work = np.zeros((1, 3, 3)), np.zeros((1, 3, 3)), np.empty((1, 3, 3))
    x, y, z = 0.0, 0.0, 0.0
    for k in range(N):
        rotations.put_inverse_jacobian(rotations.vector_at(phis, k, FIRST), jacobians, k)
        turned = rotations.times(
            jacobians, k, rotations.vector_at(poses.twists, k, rotations.ANGULAR)
        )
        x, y, z = (
            x + weights[k] * turned[0],
            y + weights[k] * turned[1],
            z + weights[k] * turned[2],
        )
        for i in range(3):
            for j in range(3):
                B[0, i, j] += weights[k] * jacobians[k, j, i]
    invert(B, FIRST, work, B_inverse, FIRST)
    omega_c = rotations.times(B_inverse, FIRST, (x, y, z))
    found, moved = np.zeros((N, 3, 3)), np.zeros((N, 3, 3))
    for k in range(N):
        phi, omega = (
            rotations.vector_at(phis, k, FIRST),
            rotations.vector_at(poses.twists, k, rotations.ANGULAR),
        )
        turned = rotations.times(jacobians, k, omega)
        back = rotations.transposed_times(jacobians, k, omega_c)
        phi_rate = turned[0] - back[0], turned[1] - back[1], turned[2] - back[2]
        rotations.put_inverse_jacobian_rate(phi, phi_rate, work, FIRST)
        for i in range(3):
            for j in range(3):
                B_rate[0, i, j] += weights[k] * work[0, j, i]
        add_product(weights[k], jacobians, k, poses.rotations, k, found, k)
        for i in range(3):  # d(A_k)/dt + A_k [omega_k], row by row.
            turning = rotations.cross(rotations.row_at(jacobians, k, i), omega)
            for j in range(3):
                work[0, i, j] += turning[j]
        add_product(weights[k], work, FIRST, poses.rotations, k, moved, k)
    for k in range(N):
        product(B_inverse, FIRST, found, k, work, FIRST)
        for i in range(3):
            for j in range(3):
                A.G[k, a + i, a + j] = work[0, i, j]
        add_product(-1.0, B_rate, FIRST, work, FIRST, moved, k)
        product(B_inverse, FIRST, moved, k, work, FIRST)
        for i in range(3):
            for j in range(3):
                A.G_rate[k, a + i, a + j] = work[0, i, j]
    return omega_c
