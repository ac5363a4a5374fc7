# SPDX-License-Identifier: Apache-2.0
"""Where energy enters and leaves a connection."""

import numpy as np

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


def shortened(vector: Array, places: Array, longest: float) -> Array:
    """The vector with some of its places made no longer than a length; 0: any length."""
    length = float(np.linalg.norm(vector[places]))
    if longest <= 0.0 or length <= longest:
        return vector
    result = vector.copy()
    result[places] *= longest / length
    return result
