# SPDX-License-Identifier: Apache-2.0
"""Roles of the subtasks in a structured team, and indices of their coordinates."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.fast.kernels.array_parts import EDGES, JOINTS, MEAN, Indices, Plan
from noninteract_ros.control.fast.robot_terms import RobotTerms
from noninteract_ros.control.fast.robotwise_dynamics import Coordinates
from noninteract_ros.subtasks.mixing import EdgeMixing, JointMixing, MeanMixing
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.subtasks.subtask import Subtask
from noninteract_ros.subtasks.team_rotation import TeamRotation
from noninteract_ros.team.robot import AXES
from noninteract_ros.team.team import Team


@dataclass(frozen=True, slots=True, eq=False)
class Roles:
    """Roles of the subtasks in a stack: a mean, the edges of a tree, and chosen joints.

    Attributes:
        axes: Axes in use.
        weights: Weights of the mean tool point, shape (N,).
        rotation: Mean orientation, or None.
        offsets: Constant rotations of the tools, shape (N, 3, 3), or None.
        steps: Traversal of the edges, see `Plan.steps`.
        framed_points: True if the edges' positions are expressed in the frame of the mean.
        framed_rotations: True if the edges' rotations are expressed in the frame of the mean.
        joints: Chosen joints, by subtask.
    """

    axes: tuple[str, ...]
    weights: Array
    rotation: TeamRotation | None
    offsets: Array | None
    steps: Indices
    framed_points: bool
    framed_rotations: bool
    joints: tuple[JointMixing, ...]

    @property
    def rows(self) -> list[int]:
        """Indices of the axes among x, y, z."""
        return [AXES.index(axis) for axis in self.axes]

    @property
    def in_q(self) -> list[int]:
        """Indices of the chosen joints in the configuration."""
        return [place for item in self.joints for place in item.in_q]

    @property
    def in_v(self) -> list[int]:
        """Indices of the chosen joints in the velocity."""
        return [place for item in self.joints for place in item.in_v]

    @classmethod
    def of(cls, team: Team, stack: SubtaskStack) -> "Roles | None":
        """Return the roles of the subtasks; None if the stack does not have this structure."""
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
        steps = _walk(edges, len(team.robots))
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
        if steps is None or not fits:
            return None
        weights = mean_points[0].weights if mean_points else np.zeros(len(team.robots))
        return cls(
            axes=axes,
            weights=weights,
            rotation=rotation,
            offsets=offsets,
            steps=steps,
            framed_points=framed_points,
            framed_rotations=framed_rotations,
            joints=joints,
        )


def _walk(edges: Sequence[EdgeMixing], count: int) -> Indices | None:
    """Return the traversal for `Plan.steps`; None if the edges are no tree over all robots."""
    pairs = edges[0].pairs
    if len(pairs) != count - 1 or any(item.pairs != pairs for item in edges):
        return None
    around: list[list[tuple[int, int, int]]] = [[] for _ in range(count)]
    for edge, (first, second) in enumerate(pairs):
        around[first].append((edge, second, -1))
        around[second].append((edge, first, 1))
    reached, steps = [0], []
    for robot in reached:  # Grows during the traversal.
        for edge, other, side in around[robot]:
            if other not in reached:
                reached.append(other)
                steps.append((edge, robot, other, side))
    return np.array(steps, dtype=np.intp) if len(reached) == count else None


def _same(first: Array | None, second: Array | None) -> bool:
    if first is None or second is None:
        return first is second
    return np.array_equal(first, second)


def _square(team: Team, h: int, joints: Sequence[JointMixing]) -> bool:
    """Return True if each robot has as many coordinates as joints."""
    chosen = [place for item in joints for place in item.in_v]
    own = [
        h + sum(part.start <= place < part.stop for place in chosen)
        for part in team.velocity_slices
    ]
    sizes = [part.stop - part.start for part in team.velocity_slices]
    return own == sizes and len(set(chosen)) == len(chosen)


def value_indices(stack: SubtaskStack) -> tuple[Indices, Indices]:
    """Return the indices of values: of mean and edges, sorted as in `Plan`, and of joints."""
    mean, edges, joints = _by_role(stack, stack.value_slices)
    return np.concatenate([np.hstack(mean).ravel(), np.hstack(edges).ravel()]), joints


def coordinates(team: Team, stack: SubtaskStack, roles: Roles, robots: RobotTerms) -> Coordinates:
    """Return the indices of the subtasks' coordinates, stacked and robot by robot."""
    mean, edges, joints = _by_role(stack, stack.slices)
    m, h = robots.m, len(roles.axes) + 3 * (roles.rotation is not None)
    used = [h] * len(team.robots)
    chosen = np.empty(len(joints), dtype=np.intp)
    for i, place in enumerate(roles.in_v):
        robot = int(robots.joints[place]) // m
        chosen[i] = robot * m + used[robot]
        used[robot] += 1
    sizes = [part.stop - part.start for part in stack.slices]
    owner = np.repeat(np.arange(len(sizes)), sizes)
    by_robot = np.lexsort((chosen // m, owner[joints]))
    order = [np.hstack(mean).ravel(), np.hstack(edges).ravel(), joints[by_robot]]
    plan = Plan(
        order=np.concatenate(order),
        owner=owner,
        chosen=chosen[by_robot],
        joints=robots.joints,
        steps=roles.steps,
        framed=roles.framed_points or roles.framed_rotations,
        parts=_parts(stack, len(roles.axes), h),
    )
    return Coordinates(
        h=h, plan=plan, slices=stack.slices, own=team.velocity_slices, chosen=chosen
    )


def _parts(stack: SubtaskStack, a: int, h: int) -> Indices:
    """Return the share of each subtask in the sorted coordinates, see `Plan.parts`."""
    rows, joints = [], 0
    for task in stack.subtasks:
        if _is(task, JointMixing):
            rows.append((JOINTS, joints, joints + task.dim))
            joints += task.dim
        else:
            role = MEAN if _is(task, MeanMixing) else EDGES
            rows.append((role, 0 if task.axes else a, h if task.rotates else a))
    return np.array(rows, dtype=np.intp)


def _by_role(
    stack: SubtaskStack, slices: Sequence[slice]
) -> tuple[list[Indices], list[Indices], Indices]:
    """Return the indices of mean and edges, each for positions and rotations, and of joints."""
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
