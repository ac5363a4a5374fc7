# SPDX-License-Identifier: Apache-2.0
"""How a subtask mixes what each robot does for itself, for laws that use that structure.

A subtask that declares none is as good as any other; its team's law then costs more.
"""

from dataclasses import dataclass

from noninteract_ros.arrays import Array
from noninteract_ros.subtasks.parts import Part
from noninteract_ros.subtasks.team_rotation import TeamRotation


@dataclass(frozen=True, slots=True, eq=False)
class MeanMixing:
    """One element: weighted mean of the tool points, mean of the tools' orientations, or both.

    Attributes:
        axes: Its axes, out of x, y and z.
        weights: Weight of each robot, shape (N,).
        rotation: The mean orientation; None if it has none.
    """

    axes: tuple[str, ...]
    weights: Array
    rotation: TeamRotation | None


@dataclass(frozen=True, slots=True, eq=False)
class EdgeMixing:
    """An element for each pair of robots: differences of tool points, rotations, or both.

    Attributes:
        axes: Its axes, out of x, y and z.
        pairs: Places of first and second robot of each pair in the team.
        rotates: Whether it has the rotations.
        offsets: Constant rotation of each tool, shape (N, 3, 3), or None.
        frame: Mean orientation that it is seen from; None: the world.
    """

    axes: tuple[str, ...]
    pairs: tuple[tuple[int, int], ...]
    rotates: bool
    offsets: Array | None
    frame: Part | None


@dataclass(frozen=True, slots=True, eq=False)
class JointMixing:
    """Chosen joints.

    Attributes:
        in_q: Place of each in the configuration.
        in_v: Place of each in the velocity.
    """

    in_q: tuple[int, ...]
    in_v: tuple[int, ...]


Mixing = MeanMixing | EdgeMixing | JointMixing
