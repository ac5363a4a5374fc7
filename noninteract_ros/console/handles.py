# SPDX-License-Identifier: Apache-2.0
"""Where each subtask can be taken hold of, and what can be driven."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.console.drive import AXES, NO_TURN, Drivable
from noninteract_ros.control.law.impedance import spread
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


def drivables(scenario: Scenario, stack: SubtaskStack) -> dict[str, Drivable]:
    """The subtasks that can be driven; postures are no places, so they have no handle.

    The speeds of the block `operator` bound all of them, its workspace the one that it names.
    """
    settings = scenario.operator or OperatorSettings()
    found = {}
    for task in stack.subtasks:
        if isinstance(task, POSTURES):
            continue
        led = scenario.subtasks[task.name].input
        names = ("max_velocity", "max_acceleration", "max_jerk")
        limits = np.array([spread(task, name, getattr(led, name)) for name in names])
        layout = task.layout
        bound = np.full(layout.dim, settings.linear_speed)
        bound[layout.angular.ravel()] = settings.angular_speed
        limits[0] = np.minimum(limits[0], bound)
        found[task.name] = Drivable(
            len(task.elements),
            tuple(task.axes),
            task.rotates,
            limits,
            settings.linear_speed,
            settings.angular_speed,
            Workspace(settings, task, limits) if task.name == settings.subtask else None,
        )
    return found


@dataclass(frozen=True)
class Handles:
    """Poses of the handles of one subtask.

    Args:
        task: The subtask.
        frame: Subtask whose rotation is that of its frame; `world` for none.
        robots: For each element, the robot that carries the handle: the first of an edge; None,
            where the value itself is a place.
    """

    task: Subtask
    frame: str
    robots: tuple[int | None, ...]

    @classmethod
    def of(cls, task: Subtask, scenario: Scenario, team: Team) -> "Handles":
        """Handles of a subtask of a scenario."""
        frame = getattr(scenario.subtasks[task.name].kind, "frame", WORLD)
        firsts = [element.split("-")[0] for element in task.elements]
        robots = [team.index(name) if name in team.names else None for name in firsts]
        return cls(task, frame, tuple(robots))

    def described(self) -> list[dict[str, Any]]:
        """For the page: name, axes and rotation of each element's handle."""
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
        """Pose of each handle in the world, shape (elements, 7).

        Args:
            value: Value of the subtask, shape (size,).
            frame: Quaternion of its frame.
            tools: Tool points, shape (N, 3) [m].
        """
        count = len(self.task.axes)
        size = count + 4 * self.task.rotates
        poses = np.empty((len(self.robots), 7))
        for number, robot in enumerate(self.robots):
            part = value[number * size : (number + 1) * size]
            # Where a subtask has no place along an axis, its handle is in the middle of the team.
            poses[number, :3] = tools.mean(axis=0) if robot is None else tools[robot]
            poses[number, 3:] = frame
            if robot is None:
                poses[number, [AXES.index(axis) for axis in self.task.axes]] = part[:count]
                poses[number, 3:] = part[count:] if self.task.rotates else NO_TURN
        return poses


def rotation_of(task: Subtask, value: Array | None) -> Array:
    """Quaternion of a subtask's first element; no turn, where it has none."""
    if value is None or not task.rotates:
        return NO_TURN
    count = len(task.axes)
    return value[count : count + 4]
