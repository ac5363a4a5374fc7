# SPDX-License-Identifier: Apache-2.0
"""State of walls from tick to tick."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from noninteract_ros.arrays import Array


@dataclass(frozen=True, slots=True)
class GovernedMotion:
    """References that walls hold back.

    Attributes:
        position: x_g of all subtasks, shape (size,).
        velocity: v_r of the joints, with which they move, shape (n,).
        multipliers: Of the rows that were active, by label.
    """

    position: Array
    velocity: Array
    multipliers: Mapping[int, float]


@dataclass(frozen=True, slots=True)
class WallState:
    """State of the walls, kept from tick to tick.

    Attributes:
        multipliers: Of the rows that were active, by label.
        stiffness: Of the barrier, of pairs that were inside [N/m].
        governed: References that are held back; None where they are followed.
    """

    multipliers: Mapping[int, float] = field(default_factory=dict)
    stiffness: Mapping[int, float] = field(default_factory=dict)
    governed: GovernedMotion | None = None


WALLS_AT_START = WallState()


@dataclass(frozen=True, slots=True)
class WallReport:
    """Walls at a tick, for telemetry.

    Attributes:
        least: Smallest distance between bodies [m], a lower bound where nothing is near.
        nearest: Names of the two, empty where nothing is near.
        active: Number of rows that push.
        held: True where references are held back.
    """

    least: float
    nearest: str
    active: int
    held: bool
