# SPDX-License-Identifier: Apache-2.0
"""A push where bodies are closer than a barrier: a potential, and damping."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.team.geometry.clearance import Clearances

LATE = 2.0  # ticks that a torque is held, at most
DAMPED = 0.2  # share of the barrier's depth from which on all of the damping acts


@dataclass(frozen=True, slots=True)
class Push:
    """Effect of a barrier at a state.

    Attributes:
        torque: Shape (n,) [N or N m].
        potential: V [J].
        stiffness: Of each pair inside, by number [N/m].
    """

    torque: Array
    potential: float
    stiffness: Mapping[int, float]


def barrier_push(
    found: Clearances,
    begins: Array,
    M_inverse: Array,
    known: Mapping[int, float],
    largest: float,
    period: float,
) -> Push:
    """Return the push of -dV/dd and of damping, V = k (d_v - d)^2 / 2 below d_v.

    A pair's k is chosen where it enters, where V is zero, and kept until it leaves: V stays a
    potential. Held for a time T over a mass m, k <= m/16 T^2 with critical damping is stable. The
    damping never pulls bodies together.

    Args:
        found: Clearances.
        begins: d_v of these pairs, shape (k,) [m]; none where not positive.
        M_inverse: Shape (n, n).
        known: Stiffness of the pairs that were inside, by number [N/m].
        largest: Largest stiffness [N/m].
        period: Time between ticks [s].
    """
    torque, potential = np.zeros(len(M_inverse)), 0.0
    stiffness: dict[int, float] = {}
    for k in np.flatnonzero((found.distances < begins) & (begins > 0.0)):
        row, depth = found.rows[k], float(begins[k] - found.distances[k])
        mass = 1.0 / max(float(row @ M_inverse @ row), 1e-9)
        fitting = min(largest, mass / (16.0 * (LATE * period) ** 2))
        spring = known.get(int(found.pairs[k]), fitting)
        stiffness[int(found.pairs[k])] = spring
        damping = min(2.0 * np.sqrt(spring * mass), mass / (2.0 * LATE * period))
        damping *= min(1.0, depth / (DAMPED * begins[k]))
        torque += max(0.0, spring * depth - damping * float(found.rates[k])) * row
        potential += 0.5 * spring * depth**2
    return Push(torque, potential, stiffness)
