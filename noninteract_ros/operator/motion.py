# SPDX-License-Identifier: Apache-2.0
"""Motions that a hand intends, as pure functions of time with exact derivatives."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from noninteract_ros.arrays import Array
from noninteract_ros.control.reference import Reference
from noninteract_ros.operator.minimum_jerk import RestToRest, blend

Motion = Callable[[float], Reference]
"""Time [s] to the intended position, velocity and acceleration in subtask coordinates."""

TREMOR_FREQUENCIES = np.array([70.0**0.5, 4.0 * 5.0**0.5, 6.0 * 3.0**0.5, 8.0 * 2.0**0.5])
"""Hz; in the band of physiological tremor, 8 to 12 Hz, with irrational ratios: never periodic."""


def still(position: ArrayLike) -> Motion:
    """Rests at a position of shape (dim,) [m]."""
    reference = Reference.still(position)
    return lambda t: reference


def swing(amplitude: ArrayLike, frequency: float, offset: ArrayLike) -> Motion:
    """Swings as offset + amplitude sin(frequency t), the operator of the paper's Section V.

    Args:
        amplitude: Amplitude of each coordinate [m], shape (dim,).
        frequency: Angular frequency [rad/s].
        offset: Value around which it swings [m], shape (dim,).
    """
    size = np.array(amplitude, dtype=np.float64)
    middle = np.array(offset, dtype=np.float64)

    def motion(t: float) -> Reference:
        sine, cosine = np.sin(frequency * t), np.cos(frequency * t)
        return Reference(
            middle + sine * size, (frequency * cosine) * size, (-(frequency**2) * sine) * size
        )

    return motion


def circle(centre: ArrayLike, radius: float, frequency: float, ramp: float) -> Motion:
    """Runs round a circle in the plane of the first two coordinates, from rest at t = 0.

    It starts at centre + (radius, 0); the angular rate grows to `frequency` along the
    minimum-jerk step.

    Args:
        centre: Centre [m], shape (dim,), dim >= 2.
        radius: Radius [m].
        frequency: Angular frequency after the start [rad/s]; negative is clockwise.
        ramp: Time in which the angular rate grows [s]; 0 starts at full rate.
    """
    middle = np.array(centre, dtype=np.float64)

    def motion(t: float) -> Reference:
        angle, rate, growth = (frequency * part for part in _spin_up(t, ramp))
        outward, along = np.zeros_like(middle), np.zeros_like(middle)
        outward[:2] = radius * np.cos(angle), radius * np.sin(angle)
        along[:2] = -outward[1], outward[0]
        return Reference(middle + outward, rate * along, growth * along - rate**2 * outward)

    return motion


def _spin_up(t: float, ramp: float) -> tuple[float, float, float]:
    """Angle, rate and its derivative for a final rate of 1."""
    if t < 0.0:
        return 0.0, 0.0, 0.0
    if t >= ramp:
        return t - 0.5 * ramp, 1.0, 0.0
    u = t / ramp
    rate, growth, _ = blend(u)
    angle = ramp * u**4 * (2.5 + u * (u - 3.0))  # the integral of `rate`
    return angle, rate, growth / ramp


def waypoints(times: ArrayLike, points: ArrayLike) -> Motion:
    """Moves from point to point with minimum jerk, at rest in each; C2 for all times.

    Args:
        times: When each point is reached [s], shape (n,), n >= 2, increasing.
        points: The points [m], shape (n, dim).
    """
    instants = np.array(times, dtype=np.float64)
    return RestToRest(instants[:-1], np.diff(instants), points)


def delayed(motion: Motion, start: float) -> Motion:
    """The motion with its own time counted from `start` [s]."""
    return lambda t: motion(t - start)


def with_tremor(motion: Motion, amplitude: float, seed: int, dim: int) -> Motion:
    """Adds physiological tremor: sinusoids between 8 and 12 Hz with random phases.

    Args:
        motion: The steady motion.
        amplitude: Bound of the tremor in each coordinate [m].
        seed: Seed of the phases; the same seed gives the same tremor.
        dim: Number of coordinates.
    """
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, (dim, TREMOR_FREQUENCIES.size))
    rates: Array = 2.0 * np.pi * TREMOR_FREQUENCIES
    share = amplitude / rates.size

    def trembling(t: float) -> Reference:
        steady = motion(t)
        angles = rates * t + phases
        sines, cosines = share * np.sin(angles), share * np.cos(angles)
        return Reference(
            steady.position + sines.sum(axis=1),
            steady.velocity + cosines @ rates,
            steady.acceleration - sines @ rates**2,
        )

    return trembling
