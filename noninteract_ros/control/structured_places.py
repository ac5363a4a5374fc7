# SPDX-License-Identifier: Apache-2.0
"""Which subtask plays which role in a structured team, and where its numbers are."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.robot_terms import RobotByRobot
from noninteract_ros.control.structured import Coordinates, Group, Places
from noninteract_ros.control.tree import Tree
from noninteract_ros.subtasks.mixing import EdgeMixing, JointMixing, MeanMixing
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.subtasks.subtask import Subtask
from noninteract_ros.subtasks.team_rotation import TeamRotation
from noninteract_ros.team.robot import AXES
from noninteract_ros.team.team import Team


@dataclass(frozen=True, slots=True, eq=False)
class Roles:
    """What the subtasks of a stack do: a mean, the edges of a tree, and chosen joints.

    Attributes:
        axes: Axes in use.
        weights: Weights of the mean tool point, shape (N,).
        rotation: Mean orientation, or None.
        offsets: Constant rotations of the tools, shape (N, 3, 3), or None.
        tree: The edges.
        framed_points: Whether the edges' positions are seen from the mean's frame.
        framed_rotations: Whether their rotations are.
        joints: The chosen joints, by subtask.
    """

    axes: tuple[str, ...]
    weights: Array
    rotation: TeamRotation | None
    offsets: Array | None
    tree: Tree
    framed_points: bool
    framed_rotations: bool
    joints: tuple[JointMixing, ...]

    @property
    def rows(self) -> list[int]:
        """Places of the axes among x, y, z."""
        return [AXES.index(axis) for axis in self.axes]

    @property
    def in_q(self) -> list[int]:
        """Places of the chosen joints in the configuration."""
        return [place for item in self.joints for place in item.in_q]

    @property
    def in_v(self) -> list[int]:
        """Places of the chosen joints in the velocity."""
        return [place for item in self.joints for place in item.in_v]

    @classmethod
    def of(cls, team: Team, stack: SubtaskStack) -> "Roles | None":
        """Roles of the subtasks; None where they do not fit."""
        found = [task.mixing for task in stack.subtasks]
        means = [item for item in found if isinstance(item, MeanMixing)]
        edges = [item for item in found if isinstance(item, EdgeMixing)]
        joints = tuple(item for item in found if isinstance(item, JointMixing))
        if len(means) + len(edges) + len(joints) < len(found):
            return None
        mean_points = [item for item in means if item.axes]
        edge_points = [item for item in edges if item.axes]
        turning_means = [item for item in means if item.rotation is not None]
        turning_edges = [item for item in edges if item.rotates]
        counts = (len(mean_points), len(edge_points), len(turning_means), len(turning_edges))
        if counts not in ((1, 1, 1, 1), (1, 1, 0, 0), (0, 0, 1, 1)):
            return None
        rotation = turning_means[0].rotation if turning_means else None
        offsets = rotation.offsets if rotation is not None else None
        tree = _tree(edges, len(team.robots))
        axes = mean_points[0].axes if mean_points else ()
        framed_points = bool(edge_points) and edge_points[0].frame is not None
        framed_rotations = bool(turning_edges) and turning_edges[0].frame is not None
        fits = (
            all(item.axes in ((), axes) for item in edges)
            and all(item.frame in (None, rotation) for item in edges)
            and all(_same(item.offsets, offsets) for item in turning_edges)
            and (axes == AXES or not framed_points)
            and _square(team, len(axes) + 3 * len(turning_means), joints)
        )
        if tree is None or not fits:
            return None
        weights = mean_points[0].weights if mean_points else np.zeros(len(team.robots))
        return cls(axes, weights, rotation, offsets, tree, framed_points, framed_rotations, joints)


def _tree(edges: Sequence[EdgeMixing], count: int) -> Tree | None:
    pairs = edges[0].pairs
    if len(pairs) != count - 1 or any(item.pairs != pairs for item in edges):
        return None
    try:
        return Tree(pairs)
    except ValueError:
        return None


def _same(first: Array | None, second: Array | None) -> bool:
    if first is None or second is None:
        return first is second
    return np.array_equal(first, second)


def _square(team: Team, h: int, joints: Sequence[JointMixing]) -> bool:
    """Whether each robot has as many coordinates as joints."""
    chosen = [place for item in joints for place in item.in_v]
    own = [
        h + sum(part.start <= place < part.stop for place in chosen)
        for part in team.velocity_slices
    ]
    sizes = [part.stop - part.start for part in team.velocity_slices]
    return own == sizes and len(set(chosen)) == len(chosen)


@dataclass(frozen=True, slots=True, eq=False)
class ValuePlaces:
    """Where the values of the roles are among all values.

    Attributes:
        mean_position: Shape (axes,).
        mean_rotation: Shape (4,) or (0,).
        edge_positions: Shape (N - 1, axes).
        edge_rotations: Shape (N - 1, 4) or (N - 1, 0).
        joints: Shape (P,).
    """

    mean_position: Places
    mean_rotation: Places
    edge_positions: Places
    edge_rotations: Places
    joints: Places

    @classmethod
    def of(cls, stack: SubtaskStack) -> "ValuePlaces":
        """Places in a stack's values."""
        mean, edges, joints = _by_role(stack, stack.value_slices)
        return cls(mean[0][0], mean[1][0], edges[0], edges[1], joints)


def coordinates(
    team: Team, stack: SubtaskStack, roles: Roles, robots: RobotByRobot
) -> Coordinates:
    """Where the coordinates of the subtasks are, stacked and robot by robot."""
    mean, edges, joints = _by_role(stack, stack.slices)
    h, m, a = len(roles.axes) + 3 * (roles.rotation is not None), robots.m, len(roles.axes)
    used = [h] * len(team.robots)
    slots = []
    for place in roles.in_v:
        robot = int(robots.slots[place]) // m
        slots.append(robot * m + used[robot])
        used[robot] += 1
    parts = [slice(0 if t.axes else a, h if t.rotates else a) for t in stack.subtasks]
    kinds = [type(task.mixing) for task in stack.subtasks]
    sizes = [part.stop - part.start for part in stack.slices]
    return Coordinates(
        h,
        np.hstack(mean)[0],
        np.hstack(edges),
        joints,
        np.array(slots, dtype=np.intp),
        stack.slices,
        np.repeat(np.arange(len(sizes)), sizes),
        tuple(p if k is MeanMixing else None for p, k in zip(parts, kinds, strict=True)),
        tuple(p if k is EdgeMixing else None for p, k in zip(parts, kinds, strict=True)),
        tuple(_groups(stack, slots, joints, m)),
    )


def _groups(
    stack: SubtaskStack, slots: Sequence[int], joints: Places, m: int
) -> list[tuple[Group, ...]]:
    """For each subtask its chosen joints, in groups of robots with equally many."""
    result = []
    for part, task in zip(stack.slices, stack.subtasks, strict=True):
        by_robot: dict[int, list[tuple[int, int]]] = defaultdict(list)
        if isinstance(task.mixing, JointMixing):
            for place, slot in zip(joints.tolist(), slots, strict=True):
                if part.start <= place < part.stop:
                    by_robot[slot // m].append((slot % m, place - part.start))
        by_count: dict[int, list[int]] = defaultdict(list)
        for robot, found in by_robot.items():
            by_count[len(found)].append(robot)
        groups = []
        for members in by_count.values():
            table = np.array([by_robot[robot] for robot in members])
            groups.append((np.array(members)[:, None], table[..., 0], table[..., 1]))
        result.append(tuple(groups))
    return result


def _by_role(
    stack: SubtaskStack, slices: Sequence[slice]
) -> tuple[list[Places], list[Places], Places]:
    """Places of mean and edges, each of positions and rotations by element, and of joints."""
    count = max(len(task.elements) for task in stack.subtasks if _is(task, EdgeMixing))
    none = np.zeros((count, 0), dtype=np.intp)
    mean, edges, joints = [none[:1], none[:1]], [none, none], [none[0]]
    for task, part in zip(stack.subtasks, slices, strict=True):
        table = np.arange(part.start, part.stop).reshape(len(task.elements), -1)
        if _is(task, JointMixing):
            joints.append(table.ravel())
            continue
        role = mean if _is(task, MeanMixing) else edges
        if task.axes:
            role[0] = table[:, : len(task.axes)]
        if task.rotates:
            role[1] = table[:, len(task.axes) :]
    return mean, edges, np.concatenate(joints)


def _is(task: Subtask, kind: type) -> bool:
    return isinstance(task.mixing, kind)
