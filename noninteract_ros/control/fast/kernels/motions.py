# SPDX-License-Identifier: Apache-2.0
"""Differences of single values and motions; see `subtasks.layout` for any number of them."""

import math
from typing import NamedTuple

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.compiler import FIRST, compiled, inner
from noninteract_ros.control.fast.kernels import rotations
from noninteract_ros.control.fast.kernels.array_parts import Indices


class Numbers(NamedTuple):
    """Index tables of a layout.

    Attributes:
        values: Indices of the scalars in a value, shape (k,).
        rates: Indices of the scalars' rates in a velocity, shape (k,).
        angles: Indices of the rates of angles, shape (w,).
        quaternions: First index of each quaternion in a value, shape (r,).
        angular: First index of each angular velocity in a velocity, shape (r,).
    """

    values: Indices
    rates: Indices
    angles: Indices
    quaternions: Indices
    angular: Indices


@inner
def quaternion_of(x: Array, first: int) -> rotations.Quaternion:
    """Return four numbers of a vector."""
    return x[first], x[first + 1], x[first + 2], x[first + 3]


@inner
def vector_of(x: Array, first: int) -> rotations.Vector:
    """Return three numbers of a vector."""
    return x[first], x[first + 1], x[first + 2]


@inner
def shorten(numbers: Numbers, e: Array) -> None:
    """Wrap differences of angles to [-pi, pi]."""
    for place in numbers.angles:
        e[place] -= 2.0 * math.pi * np.rint(e[place] / (2.0 * math.pi))


@compiled
def difference(numbers: Numbers, x: Array, x_d: Array) -> Array:
    """Return x - x_d: log(R R_d') for rotations, wrapped for angles; shape (dim,)."""
    e = np.empty(len(numbers.values) + 3 * len(numbers.quaternions))
    for i in range(len(numbers.values)):
        e[numbers.rates[i]] = x[numbers.values[i]] - x_d[numbers.values[i]]
    for i in range(len(numbers.quaternions)):
        place = numbers.quaternions[i]
        back = rotations.inverse(quaternion_of(x_d, place))
        phi = rotations.log(rotations.product(quaternion_of(x, place), back))
        for j in range(3):
            e[numbers.angular[i] + j] = phi[j]
    shorten(numbers, e)
    return e


@compiled
def deviation(
    numbers: Numbers,
    x: Array,
    velocity: Array,
    before: Array,
    rate: Array,
    growth: Array,
    dt: float,
) -> tuple[Array, Array]:
    """Return the difference, and its rate, of a motion from an extrapolated earlier one.

    Args:
        numbers: Index tables of the layout.
        x: Value of the motion, shape (size,).
        velocity: Velocity of the motion, shape (dim,).
        before: Value of the earlier motion, shape (size,).
        rate: Velocity of the earlier motion, shape (dim,).
        growth: Acceleration of the earlier motion, shape (dim,).
        dt: Time between both [s].
    """
    e, e_rate = np.empty(len(velocity)), np.empty(len(velocity))
    half = 0.5 * dt * dt
    for i in range(len(numbers.values)):
        place, other = numbers.rates[i], numbers.values[i]
        e[place] = x[other] - (before[other] + dt * rate[place] + half * growth[place])
        e_rate[place] = velocity[place] - (rate[place] + dt * growth[place])
    A = np.empty((1, 3, 3))
    for i in range(len(numbers.quaternions)):
        place, other = numbers.angular[i], numbers.quaternions[i]
        omega, alpha = vector_of(rate, place), vector_of(growth, place)
        way = rotations.combined(half, alpha, (dt * omega[0], dt * omega[1], dt * omega[2]))
        turned = rotations.product(rotations.exp(way), quaternion_of(before, other))
        back = rotations.inverse(rotations.normalized(turned))
        phi = rotations.log(rotations.product(quaternion_of(x, other), back))
        rotations.put_jacobian(way, A, FIRST)
        led = rotations.times(A, FIRST, rotations.combined(dt, alpha, omega))
        rotations.put_matrix(rotations.exp(phi), A, FIRST)
        carried = rotations.times(A, FIRST, led)
        rotations.put_inverse_jacobian(phi, A, FIRST)
        own = vector_of(velocity, place)
        phi_rate = rotations.times(A, FIRST, rotations.combined(-1.0, carried, own))
        for j in range(3):
            e[place + j], e_rate[place + j] = phi[j], phi_rate[j]
    shorten(numbers, e)
    return e, e_rate
