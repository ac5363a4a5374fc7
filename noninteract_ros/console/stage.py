# SPDX-License-Identifier: Apache-2.0
"""Everything that the page draws, in the order that its greeting gives."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.console.drive import NO_TURN
from noninteract_ros.console.frames import meshes
from noninteract_ros.console.handles import WORLD, Handles, rotation_of
from noninteract_ros.console.protocol import VERSION
from noninteract_ros.console.shapes import described, mesh_bytes, team_shapes
from noninteract_ros.console.surroundings import edges, walls
from noninteract_ros.console.view import SceneState
from noninteract_ros.control.law.decoupling import LAWS
from noninteract_ros.scenario import Scenario
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team


class Stage:
    """Team, references, surroundings and handles of one scenario.

    Args:
        scenario: The scenario.
        team: Its team; not shared with other threads.
        stack: Its subtasks.

    Attributes:
        body_names: Names of the bodies whose poses are drawn.
    """

    def __init__(self, scenario: Scenario, team: Team, stack: SubtaskStack) -> None:
        self._scenario, self._team, self._stack = scenario, team, stack
        self._view = SceneState(team, stack)
        self._handles = {task.name: Handles.of(task, scenario, team) for task in stack.subtasks}
        plant = scenario.build_simulation(team, stack).plant
        shapes = team_shapes(scenario, plant)
        self._meshes, self._shapes = meshes(mesh_bytes(shapes)), described(shapes)
        self.body_names = plant.body_names

    def greeting(self, told: Mapping[str, Any]) -> list[str | bytes]:
        """Description of all that is drawn, with what else is told, and the meshes."""
        content = {
            "kind": "hello",
            "version": VERSION,
            "robots": list(self._team.names),
            "joints": self._team.model.njoints - 1,
            "shapes": self._shapes,
            "bodies": len(self.body_names),
            "walls": walls(self._scenario),
            "edges": edges(self._scenario, self._team),
            "laws": list(LAWS),
            "subtasks": [
                {"name": name, "handles": handles.described()}
                for name, handles in self._handles.items()
            ],
        }
        return [json.dumps(content | dict(told)), self._meshes]

    def frames(self, state: Mapping[str, Array]) -> dict[str, Array]:
        """Quaternion of the frame that each subtask is seen from."""
        rotations = {
            task.name: rotation_of(task, state.get(task.name)) for task in self._stack.subtasks
        }
        rotations[WORLD] = NO_TURN
        return {name: rotations[handles.frame] for name, handles in self._handles.items()}

    def poses(
        self,
        q: Array,
        state: Mapping[str, Array],
        desired: Mapping[str, Array],
        body_poses: Array,
    ) -> list[Array]:
        """Poses of joints, of the ghost's joints, of bodies, handles and tools; NaN hides one."""
        joints, tools = self._view.joints(q), self._view.tools(q)
        ghost = np.full_like(joints, np.nan)
        if len(desired) == len(self._handles):
            wanted = np.concatenate([desired[name] for name in self._handles])
            ghost = self._view.joints(self._view.ghost(q, wanted))
        else:
            self._view.forget()
        frames = self.frames(state)
        handles = [
            item.poses(state[name], frames[name], tools)
            if name in state
            else np.full((len(item.robots), 7), np.nan)
            for name, item in self._handles.items()
        ]
        turned = np.hstack([tools, np.tile(NO_TURN, (len(tools), 1))])
        return [joints, ghost, body_poses, *handles, turned]

    def sample(
        self, time: float, state: Mapping[str, Array], desired: Mapping[str, Array]
    ) -> dict[str, Any]:
        """Tracking error of each subtask: largest distance [m] and angle [rad] of an element."""
        errors, angles = {}, {}
        for task in self._stack.subtasks:
            if task.name in state and task.name in desired:
                e = task.difference(state[task.name], desired[task.name])
                found = task.magnitudes(e)
                if "m" in found:
                    errors[task.name] = float(found["m"].max())
                if "rad" in found:
                    angles[task.name] = float(found["rad"].max())
        return {"kind": "sample", "time": time, "errors": errors, "angles": angles}
