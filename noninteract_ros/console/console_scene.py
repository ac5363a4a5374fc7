# SPDX-License-Identifier: Apache-2.0
"""Scene that pages draw: greeting with everything static, poses and tracking errors."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.console.drive import IDENTITY_ROTATION
from noninteract_ros.console.frames import encode_meshes
from noninteract_ros.console.handles import WORLD, Handles, rotation_of
from noninteract_ros.console.protocol import VERSION
from noninteract_ros.console.scene_kinematics import SceneKinematics
from noninteract_ros.control.law.decoupling import LAWS
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.shapes import Shape, shapes_of
from noninteract_ros.simulation.environment import Wall
from noninteract_ros.simulation.plant import Plant
from noninteract_ros.subtasks.kinds.edges import edge_indices, edge_pairs
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team

MIN_RADIUS = 0.6  # [m] of a team, so that point masses close to each other stay visible


class ConsoleScene:
    """Team, ghost, environment and handles of one scenario.

    Args:
        scenario: The scenario.
        team: Its team; not shared with other threads.
        stack: Its subtasks.

    Attributes:
        body_names: Names of the moving bodies.
    """

    def __init__(self, scenario: Scenario, team: Team, stack: SubtaskStack) -> None:
        self._scenario, self._team, self._stack = scenario, team, stack
        self._kinematics = SceneKinematics(team, stack)
        self._handles = {task.name: Handles.of(task, scenario, team) for task in stack.subtasks}
        plant = scenario.build_simulation(team, stack).plant
        shapes = scene_shapes(scenario, plant)
        self._meshes = encode_meshes(shapes)
        self._shapes = [{"joint": int(shape.joint), "robot": shape.owner} for shape in shapes]
        self.body_names = plant.body_names

    def greeting(self, extra: Mapping[str, Any]) -> list[str | bytes]:
        """Return the messages that open a connection: scene description and meshes.

        Args:
            extra: Further keys of the description.
        """
        content = {
            "kind": "hello",
            "version": VERSION,
            "robots": list(self._team.names),
            "joints": self._team.model.njoints - 1,
            "shapes": self._shapes,
            "bodies": len(self.body_names),
            "walls": wall_planes(self._scenario),
            "edges": robot_edges(self._scenario, self._team),
            "laws": list(LAWS),
            "subtasks": [
                {"name": name, "handles": handles.describe()}
                for name, handles in self._handles.items()
            ],
        }
        return [json.dumps(content | dict(extra)), self._meshes]

    def frames(self, state: Mapping[str, Array]) -> dict[str, Array]:
        """Return the quaternion of each subtask's frame in the world."""
        rotations = {
            task.name: rotation_of(task, state.get(task.name)) for task in self._stack.subtasks
        }
        rotations[WORLD] = IDENTITY_ROTATION
        return {name: rotations[handles.frame] for name, handles in self._handles.items()}

    def poses(
        self,
        q: Array,
        state: Mapping[str, Array],
        desired: Mapping[str, Array],
        body_poses: Array,
    ) -> list[Array]:
        """Return all poses of a frame, in the order in which the page reads them.

        The order is joints, ghost joints, bodies, handles, tools. NaN hides an object.

        Args:
            q: Configuration of the team, shape (nq,).
            state: Measured value of each subtask.
            desired: Desired value of each subtask.
            body_poses: Poses of the moving bodies, shape (bodies, 7).
        """
        joints, tools = self._kinematics.joints(q), self._kinematics.tools(q)
        ghost = np.full_like(joints, np.nan)
        if len(desired) == len(self._handles):
            goal = np.concatenate([desired[name] for name in self._handles])
            ghost = self._kinematics.joints(self._kinematics.ghost(q, goal))
        else:
            self._kinematics.reset_ghost()
        frames = self.frames(state)
        handles = [
            item.poses(state[name], frames[name], tools)
            if name in state
            else np.full((len(item.robots), 7), np.nan)
            for name, item in self._handles.items()
        ]
        tool_poses = np.hstack([tools, np.tile(IDENTITY_ROTATION, (len(tools), 1))])
        return [joints, ghost, body_poses, *handles, tool_poses]

    def sample(
        self, time: float, state: Mapping[str, Array], desired: Mapping[str, Array]
    ) -> dict[str, Any]:
        """Return the plotted tracking errors of one instant.

        The error of a subtask is the largest distance [m] and angle [rad] of an element.
        """
        errors, angles = {}, {}
        for task in self._stack.subtasks:
            if task.name in state and task.name in desired:
                e = task.difference(state[task.name], desired[task.name])
                magnitudes = task.magnitudes(e)
                if "m" in magnitudes:
                    errors[task.name] = float(magnitudes["m"].max())
                if "rad" in magnitudes:
                    angles[task.name] = float(magnitudes["rad"].max())
        return {"kind": "sample", "time": time, "errors": errors, "angles": angles}


def scene_shapes(scenario: Scenario, plant: Plant) -> list[Shape]:
    """Return the convex bodies on the joints of a plant, with as few triangles as they have."""
    team = plant.team
    tools = team.state(team.q0, np.zeros(team.n)).tool_positions
    radius = float(np.linalg.norm(tools - tools.mean(axis=0), axis=1).max())
    return shapes_of(scenario, plant, max(MIN_RADIUS, radius), np.inf)


def wall_planes(scenario: Scenario) -> list[dict[str, Any]]:
    """Return name, point and normal of each wall."""
    return [
        {"name": name, "point": list(block.point), "normal": list(block.normal)}
        for name, block in scenario.surroundings.items()
        if isinstance(block, Wall)
    ]


def robot_edges(scenario: Scenario, team: Team) -> list[tuple[int, int]]:
    """Return the pairs of robots that a relative subtask connects."""
    found: list[tuple[int, int]] = []
    for name, spec in scenario.subtasks.items():
        given = getattr(spec.kind, "edges", None)
        if given is not None:
            found += edge_indices(edge_pairs(name, given, team), team)
    return sorted(set(found))
