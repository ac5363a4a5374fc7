# SPDX-License-Identifier: Apache-2.0
"""Handles of the subtasks: drivable subtasks and poses of their handles."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.console.drive import AXES, IDENTITY_ROTATION, DrivableSubtask
from noninteract_ros.control.law.impedance import per_coordinate
from noninteract_ros.scenario import Scenario
from noninteract_ros.sources.human.input_settings import OperatorSettings
from noninteract_ros.sources.human.input_shaping import Workspace
from noninteract_ros.subtasks.kinds.elbow_angle import ElbowAngles
from noninteract_ros.subtasks.kinds.posture import JointSelection
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.subtasks.subtask import Subtask
from noninteract_ros.team.team import Team

WORLD = "world"
POSTURES = (JointSelection, ElbowAngles)


def drivable_subtasks(scenario: Scenario, stack: SubtaskStack) -> dict[str, DrivableSubtask]:
    """Return the subtasks that an operator can drive, by name.

    Postures have no handle, because their values are not positions. The speeds of the block
    `operator` bound all subtasks; its workspace bounds the one that it names.
    """
    settings = scenario.operator or OperatorSettings()
    found = {}
    for task in stack.subtasks:
        if isinstance(task, POSTURES):
            continue
        bounds = scenario.subtasks[task.name].input
        names = ("max_velocity", "max_acceleration", "max_jerk")
        limits = np.array([per_coordinate(task, name, getattr(bounds, name)) for name in names])
        layout = task.layout
        speed = np.full(layout.dim, settings.linear_speed)
        speed[layout.angular.ravel()] = settings.angular_speed
        limits[0] = np.minimum(limits[0], speed)
        in_workspace = task.name == settings.subtask
        found[task.name] = DrivableSubtask(
            elements=len(task.elements),
            axes=tuple(task.axes),
            rotates=task.rotates,
            limits=limits,
            linear_speed=settings.linear_speed,
            angular_speed=settings.angular_speed,
            workspace=Workspace(settings, task, limits) if in_workspace else None,
        )
    return found


@dataclass(frozen=True)
class Handles:
    """Handles of one subtask, one per element.

    Attributes:
        task: The subtask.
        frame: Subtask whose rotation is the frame of this one, or `world`.
        robots: Index of the robot whose tool carries the handle, for each element: the first of
            an edge. None where the value itself is a position.
    """

    task: Subtask
    frame: str
    robots: tuple[int | None, ...]

    @classmethod
    def of(cls, task: Subtask, scenario: Scenario, team: Team) -> "Handles":
        """Return the handles of a subtask of a scenario."""
        frame = getattr(scenario.subtasks[task.name].kind, "frame", WORLD)
        firsts = [element.split("-")[0] for element in task.elements]
        robots = [team.index(name) if name in team.names else None for name in firsts]
        return cls(task, frame, tuple(robots))

    def describe(self) -> list[dict[str, Any]]:
        """Return index, label, axes and rotation of each handle for the greeting."""
        return [
            {
                "element": number,
                "label": element,
                "axes": list(self.task.axes),
                "rotates": self.task.rotates,
            }
            for number, element in enumerate(self.task.elements)
        ]

    def poses(self, value: Array, frame: Array, tools: Array) -> Array:
        """Return the pose of each handle in the world, shape (elements, 7).

        Args:
            value: Value of the subtask, shape (size,).
            frame: Quaternion of the subtask's frame in the world.
            tools: Tool points, shape (N, 3) [m].
        """
        count = len(self.task.axes)
        size = count + 4 * self.task.rotates
        poses = np.empty((len(self.robots), 7))
        for number, robot in enumerate(self.robots):
            part = value[number * size : (number + 1) * size]
            # Along axes that the subtask does not have, the handle is at the centre of the team.
            poses[number, :3] = tools.mean(axis=0) if robot is None else tools[robot]
            poses[number, 3:] = frame
            if robot is None:
                poses[number, [AXES.index(axis) for axis in self.task.axes]] = part[:count]
                poses[number, 3:] = part[count:] if self.task.rotates else IDENTITY_ROTATION
        return poses


def rotation_of(task: Subtask, value: Array | None) -> Array:
    """Return the quaternion of a subtask's first element; the identity where it has none."""
    if value is None or not task.rotates:
        return IDENTITY_ROTATION
    count = len(task.axes)
    return value[count : count + 4]
