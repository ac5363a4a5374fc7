# SPDX-License-Identifier: Apache-2.0
"""References that respect walls: nobody winds up springs against what cannot give way."""

from dataclasses import dataclass, replace

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.walls.state import GovernedMotion
from noninteract_ros.subtasks.layout import Layout

RETURN_RATE = 20.0  # [1/s] at which a governed reference comes back, critically damped
RETURN_ACCELERATION = 8.0  # [m/s^2 or rad/s^2] of all coordinates together
AT_PLACE, AT_SPEED = 1e-7, 1e-6  # [m or rad; per s] within which a reference is its own again


@dataclass(frozen=True, slots=True)
class Desired:
    """Stacked references of all subtasks.

    Attributes:
        position: x_d, shape (size,).
        velocity: Shape (p,).
        acceleration: Shape (p,).
    """

    position: Array
    velocity: Array
    acceleration: Array


def pull(gap: Array) -> Array:
    """Return the acceleration that closes a gap x_g - x_d, shape (p,), of bounded size.

    All coordinates are scaled alike: where a wall holds some of them, the others find a place of
    rest.
    """
    wanted = RETURN_RATE**2 * gap
    size = float(np.linalg.norm(wanted)) / RETURN_ACCELERATION
    return wanted / np.sqrt(1.0 + size**2)


def target(desired: Desired, gap: Array, velocity: Array) -> Array:
    """Return the task acceleration that leads a governed reference to the desired one, (p,).

    Args:
        desired: Where sources lead.
        gap: x_g - x_d, shape (p,).
        velocity: That of the governed reference, J v_r, shape (p,).
    """
    behind = desired.velocity - velocity
    return desired.acceleration + 2.0 * RETURN_RATE * behind - pull(gap)


def arrived(desired: Desired, gap: Array, velocity: Array) -> bool:
    """Return True where a governed reference is the desired one but for rounding."""
    off = float(np.abs(gap).max())
    return off <= AT_PLACE and float(np.abs(velocity - desired.velocity).max()) <= AT_SPEED


def advanced(
    motion: GovernedMotion, governed: Desired, acceleration: Array, step: float, layout: Layout
) -> GovernedMotion:
    """Return a governed motion one step later [s].

    Args:
        motion: At this tick.
        governed: The reference that it gives.
        acceleration: a_r, shape (n,).
        step: Time to the next tick [s].
        layout: Layout of the stacked values.
    """
    now = governed.position, governed.velocity, governed.acceleration
    position = layout.extrapolate(now, step)[0]
    return replace(motion, position=position, velocity=motion.velocity + step * acceleration)
