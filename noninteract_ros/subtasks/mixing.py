# SPDX-License-Identifier: Apache-2.0
"""Structure of a subtask: the combination of the robots' motions, for robot-by-robot laws.

A subtask without a declared structure is supported as well; its law is evaluated in dense form,
at a higher cost.
"""

from dataclasses import dataclass

from noninteract_ros.arrays import Array
from noninteract_ros.subtasks.components import Component
from noninteract_ros.subtasks.team_rotation import TeamRotation


@dataclass(frozen=True, slots=True, eq=False)
class MeanMixing:
    """One element: weighted mean of the tool points, mean of the tool orientations, or both.

    Attributes:
        axes: Axes of the position, out of x, y and z.
        weights: Weight of each robot, shape (N,).
        rotation: Mean orientation; None without one.
    """

    axes: tuple[str, ...]
    weights: Array
    rotation: TeamRotation | None


@dataclass(frozen=True, slots=True, eq=False)
class EdgeMixing:
    """One element per pair of robots: differences of tool points, rotations, or both.

    Attributes:
        axes: Axes of the position, out of x, y and z.
        pairs: Indices of the first and second robot of each pair in the team.
        rotates: True if the elements have rotations.
        offsets: Constant rotation of each tool, shape (N, 3, 3), or None.
        frame: Mean orientation that serves as reference frame; None for the world.
    """

    axes: tuple[str, ...]
    pairs: tuple[tuple[int, int], ...]
    rotates: bool
    offsets: Array | None
    frame: Component | None


@dataclass(frozen=True, slots=True, eq=False)
class JointMixing:
    """Chosen joints.

    Attributes:
        in_q: Index of each joint in the configuration.
        in_v: Index of each joint in the velocity.
    """

    in_q: tuple[int, ...]
    in_v: tuple[int, ...]


Mixing = MeanMixing | EdgeMixing | JointMixing
