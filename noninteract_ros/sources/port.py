# SPDX-License-Identifier: Apache-2.0
"""Energy ports of a link, and projections of efforts onto energy limits."""

import numpy as np
from scipy.optimize import brentq

from noninteract_ros.arrays import Array

TINY = 1e-300  # Keeps a division by a number that may be zero finite.


class Port:
    """Energy that has passed a port, counted separately for each direction.

    Attributes:
        absorbed: Energy that entered the link here, never falling [J].
        delivered: Energy that left the link here, never falling [J].
    """

    def __init__(self) -> None:
        self.absorbed = self.delivered = 0.0

    def add(self, work: float) -> None:
        """Count energy delivered [J]; negative work is absorbed."""
        if work > 0.0:
            self.delivered += work
        else:
            self.absorbed -= work


def limit_power(effort: Array, flow: Array, metric: Array, limit: float) -> Array:
    """Return the nearest effort whose power on a flow does not exceed a limit.

    Args:
        effort: Force on a given velocity, or velocity against a given force, shape (p,).
        flow: The given velocity or force, shape (p,).
        metric: Weights that convert the flow to an effort, shape (p,).
        limit: Largest power [W], not negative.
    """
    excess = float(effort @ flow) - limit
    if excess <= 0.0:
        return effort
    direction = metric * flow
    return effort - (excess / max(float(direction @ flow), TINY)) * direction


def limit_work(
    effort: Array, displacement: Array, metric: Array, uncertainty: float, limit: float
) -> Array:
    """Return the nearest force whose work stays within a limit for every possible displacement.

    The displacement x is known up to an uncertainty r: it lies in the ball |x' - x| <= r. Lengths
    are |x|^2 = x' G x for displacements and |f|^2 = f' G^-1 f for forces. Then the work is at most
    f' x + r |f|. This bound is convex in f, and its Lagrange condition is
    f (1 + l r / |f|) = effort - l G x: damping l is taken off, then the rest is shortened by l r.
    The least l >= 0 that meets the limit gives the nearest force.

    Args:
        effort: Wanted force, shape (p,).
        displacement: Expected displacement x, shape (p,).
        metric: G, positive, shape (p,).
        uncertainty: r, not negative.
        limit: Largest work [J], not negative.
    """
    drag = metric * displacement
    work, size = float(effort @ displacement), float(effort @ (effort / metric))
    if work + uncertainty * np.sqrt(size) <= limit:
        return effort
    length = float(drag @ displacement)

    def remainder(damping: float) -> tuple[float, float]:
        """Return the length after damping, and the share of it that remains after shortening."""
        left = float(np.sqrt(max(size - damping * (2.0 * work - damping * length), 0.0)))
        return left, max(1.0 - damping * uncertainty / max(left, TINY), 0.0)

    def excess(damping: float) -> float:
        left, share = remainder(damping)
        return share * (work - damping * length + uncertainty * left) - limit

    most = 1.0
    while excess(most) > 0.0:
        most *= 2.0
        if not np.isfinite(most * most * length):
            return np.zeros_like(effort)
    damping = brentq(excess, 0.0, most)
    result: Array = remainder(damping)[1] * (effort - damping * drag)
    return result


def limit_norm(vector: Array, places: Array, longest: float) -> Array:
    """Scale some components of a vector so that their norm meets a limit; 0 means no limit."""
    length = float(np.linalg.norm(vector[places]))
    if longest <= 0.0 or length <= longest:
        return vector
    result = vector.copy()
    result[places] *= longest / length
    return result
