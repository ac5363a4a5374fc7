# SPDX-License-Identifier: Apache-2.0
"""Where energy enters and leaves a connection."""

import numpy as np
from scipy.optimize import brentq

from noninteract_ros.arrays import Array

TINY = 1e-300  # keeps a division by what may be zero harmless


class Port:
    """Counts the energy that passes a port, either way by itself.

    Attributes:
        taken: Energy that the connection has taken up here, never falling [J].
        given: Energy that it has given away here, never falling [J].
    """

    def __init__(self) -> None:
        self.taken = self.given = 0.0

    def give(self, work: float) -> None:
        """Notes energy given away [J]; a negative one was taken up."""
        if work > 0.0:
            self.given += work
        else:
            self.taken -= work


def without_excess(effort: Array, flow: Array, metric: Array, limit: float) -> Array:
    """The nearest effort whose power on a flow does not exceed a limit.

    Args:
        effort: Force on a given velocity, or velocity against a given force, shape (p,).
        flow: The given velocity or force, shape (p,).
        metric: Weights that make the flow an effort, shape (p,).
        limit: Most power [W], not negative.
    """
    excess = float(effort @ flow) - limit
    if excess <= 0.0:
        return effort
    direction = metric * flow
    return effort - (excess / max(float(direction @ flow), TINY)) * direction


def affordable(effort: Array, way: Array, metric: Array, doubt: float, limit: float) -> Array:
    """The nearest force whose work stays within a limit wherever the displacement ends.

    The displacement is known up to a doubt d: it lies in the ball |way' - way| <= d. With lengths
    |way|^2 = way' G way of displacements and |f|^2 = f' G^-1 f of forces, the work is at most
    f' way + d |f|. That is convex in f, and its Lagrange condition is f (1 + l d / |f|) =
    effort - l G way: damping l is taken off, then the rest is shortened by l d. The least l >= 0
    that meets the limit gives the nearest force.

    Args:
        effort: Wanted force, shape (p,).
        way: Expected displacement, shape (p,).
        metric: G, positive, shape (p,).
        doubt: d, not negative.
        limit: Most work, not negative.
    """
    drag = metric * way
    work, size = float(effort @ way), float(effort @ (effort / metric))
    if work + doubt * np.sqrt(size) <= limit:
        return effort
    length = float(drag @ way)

    def shortened_by(damping: float) -> tuple[float, float]:
        """Length of what damping leaves, and the share of it that its price in doubt leaves."""
        left = float(np.sqrt(max(size - damping * (2.0 * work - damping * length), 0.0)))
        return left, max(1.0 - damping * doubt / max(left, TINY), 0.0)

    def excess(damping: float) -> float:
        left, share = shortened_by(damping)
        return share * (work - damping * length + doubt * left) - limit

    most = 1.0
    while excess(most) > 0.0:
        most *= 2.0
        if not np.isfinite(most * most * length):
            return np.zeros_like(effort)
    damping = brentq(excess, 0.0, most)
    result: Array = shortened_by(damping)[1] * (effort - damping * drag)
    return result


def shortened(vector: Array, places: Array, longest: float) -> Array:
    """The vector with some of its places made no longer than a length; 0: any length."""
    length = float(np.linalg.norm(vector[places]))
    if longest <= 0.0 or length <= longest:
        return vector
    result = vector.copy()
    result[places] *= longest / length
    return result
