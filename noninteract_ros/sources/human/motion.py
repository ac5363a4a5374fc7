# SPDX-License-Identifier: Apache-2.0
"""Intended motions of a hand, as pure functions of time with exact derivatives."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from noninteract_ros.arrays import Array
from noninteract_ros.sources.minimum_jerk import RestToRest, blend
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference

Trajectory = Callable[[float], Reference]
"""Function from time [s] to intended position, velocity and acceleration of a subtask."""

TREMOR_FREQUENCIES = np.array([70.0**0.5, 4.0 * 5.0**0.5, 6.0 * 3.0**0.5, 8.0 * 2.0**0.5])
"""Frequencies in the band of physiological tremor, 8 to 12 Hz [Hz].

Their ratios are irrational, so that their sum is not periodic.
"""


def still(position: ArrayLike, layout: Layout | None = None) -> Trajectory:
    """Build a rest at a value of shape (size,) [m; quaternions]."""
    reference = Reference.at_rest(position, layout)
    return lambda t: reference


def swing(amplitude: ArrayLike, frequency: float, offset: ArrayLike) -> Trajectory:
    """Build the oscillation offset + amplitude sin(frequency t), the paper's Section V operator.

    Args:
        amplitude: Amplitude of each coordinate [m], shape (dim,).
        frequency: Angular frequency [rad/s].
        offset: Mean value [m], shape (dim,).
    """
    size = np.array(amplitude, dtype=np.float64)
    middle = np.array(offset, dtype=np.float64)

    def motion(t: float) -> Reference:
        sine, cosine = np.sin(frequency * t), np.cos(frequency * t)
        return Reference(
            middle + sine * size, (frequency * cosine) * size, (-(frequency**2) * sine) * size
        )

    return motion


def circle(centre: ArrayLike, radius: float, frequency: float, ramp: float) -> Trajectory:
    """Build a circle in the plane of the first two coordinates, from rest at t = 0.

    The motion starts at centre + (radius, 0). The angular rate rises to `frequency` along the
    minimum-jerk step.

    Args:
        centre: Centre [m], shape (dim,), dim >= 2.
        radius: Radius [m].
        frequency: Angular frequency after the start [rad/s]; negative is clockwise.
        ramp: Rise time of the angular rate [s]; 0 starts at full rate.
    """
    middle = np.array(centre, dtype=np.float64)

    def motion(t: float) -> Reference:
        angle, rate, growth = (frequency * part for part in _spin_up(t, ramp))
        outward, along = np.zeros_like(middle), np.zeros_like(middle)
        outward[:2] = radius * np.cos(angle), radius * np.sin(angle)
        along[:2] = -outward[1], outward[0]
        return Reference(middle + outward, rate * along, growth * along - rate**2 * outward)

    return motion


def rocking(rotation: ArrayLike, frequency: float, ramp: float) -> Trajectory:
    """Build rotation vectors in phase with the sine of a circle's angle, from rest at t = 0.

    Args:
        rotation: Amplitude of the rotation vectors [rad], shape (dim,).
        frequency: Angular frequency after the start [rad/s].
        ramp: Rise time of the angular rate [s]; 0 starts at full rate.
    """
    size = np.array(rotation, dtype=np.float64)

    def motion(t: float) -> Reference:
        angle, rate, growth = (frequency * part for part in _spin_up(t, ramp))
        sine, cosine = np.sin(angle), np.cos(angle)
        return Reference(
            sine * size, (rate * cosine) * size, (growth * cosine - rate**2 * sine) * size
        )

    return motion


def _spin_up(t: float, ramp: float) -> tuple[float, float, float]:
    """Return angle, rate and its derivative for a final rate of 1."""
    if t < 0.0:
        return 0.0, 0.0, 0.0
    if t >= ramp:
        return t - 0.5 * ramp, 1.0, 0.0
    u = t / ramp
    rate, growth, _ = blend(u)
    angle = ramp * u**4 * (2.5 + u * (u - 3.0))  # The integral of `rate`.
    return angle, rate, growth / ramp


def waypoints(times: ArrayLike, points: ArrayLike, layout: Layout | None = None) -> Trajectory:
    """Build minimum-jerk moves from point to point, at rest in each; C2 for all times.

    Args:
        times: Time of arrival at each point [s], shape (n,), n >= 2, increasing.
        points: The points [m; quaternions], shape (n, size).
        layout: Layout of a point; plain numbers, if None.
    """
    instants = np.array(times, dtype=np.float64)
    return RestToRest(instants[:-1], np.diff(instants), points, layout)


def with_rotation(
    translation: Trajectory, rotation: Trajectory, orientations: ArrayLike, layout: Layout
) -> Trajectory:
    """Combine a translational and a rotational motion.

    Args:
        translation: Trajectory of the plain numbers.
        rotation: Trajectory of the rotation vectors away from the orientations [rad].
        orientations: Quaternion of each rotation, one after the other.
        layout: Layout of the result.
    """
    middle = layout.identity.copy()
    middle[layout.quaternions] = np.reshape(orientations, (-1, 4))
    base = Reference.at_rest(middle, layout)

    def motion(t: float) -> Reference:
        p, r = translation(t), rotation(t)
        gap = Reference(
            layout.stack_components(p.position, r.position),
            layout.stack_components(p.velocity, r.velocity),
            layout.stack_components(p.acceleration, r.acceleration),
        )
        return base.plus(gap, layout)

    return motion


def delayed(motion: Trajectory, start: float) -> Trajectory:
    """Delay a motion: count its time from `start` [s]."""
    return lambda t: motion(t - start)


def with_tremor(motion: Trajectory, amplitude: ArrayLike, seed: int, layout: Layout) -> Trajectory:
    """Add physiological tremor: sinusoids between 8 and 12 Hz with random phases.

    Args:
        motion: The steady motion.
        amplitude: Bound of the tremor, for all coordinates or for each, shape (dim,) [m; rad].
        seed: Seed of the phases; the same seed gives the same tremor.
        layout: Layout of the motion's values.
    """
    rates: Array = 2.0 * np.pi * TREMOR_FREQUENCIES
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, (layout.dim, rates.size))
    share = np.broadcast_to(amplitude, (layout.dim,))[:, None] / rates.size

    def trembling(t: float) -> Reference:
        angles = rates * t + phases
        sines, cosines = share * np.sin(angles), share * np.cos(angles)
        tremor = Reference(sines.sum(axis=1), cosines @ rates, -(sines @ rates**2))
        return motion(t).plus(tremor, layout)

    return trembling
