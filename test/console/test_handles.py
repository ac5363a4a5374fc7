# SPDX-License-Identifier: Apache-2.0
"""Drivable subtasks, poses of their handles, and the scene that the page draws."""

import json
import struct

import numpy as np
import pytest
from repository import ROOT

from noninteract_ros.console.console_scene import ConsoleScene
from noninteract_ros.console.drive import IDENTITY_ROTATION
from noninteract_ros.console.handles import Handles, drivable_subtasks
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import read_parameters
from noninteract_ros.subtasks import so3


def load(name: str, **changes: object) -> Scenario:
    return Scenario.from_dict(read_parameters(ROOT / "config" / f"{name}.yaml") | changes)


def build_scene(scenario: Scenario) -> tuple[ConsoleScene, np.ndarray, dict[str, np.ndarray]]:
    """Return a scene, and configuration and subtask values at the start."""
    team = scenario.build_team()
    stack = scenario.build_stack(team)
    x = stack.evaluate(team.state(team.q0, np.zeros(team.n))).x
    values = {name: x[part] for name, part in zip(stack.names, stack.value_slices, strict=True)}
    return ConsoleScene(scenario, team, stack), team.q0, values


@pytest.mark.parametrize("name", ["paper", "planar_arms", "carry", "door", "wall", "formation"])
def test_the_greeting_matches_the_frames(name: str) -> None:
    """There is a mesh for each shape, and a pose for each object that the page places."""
    scene, q, values = build_scene(load(name))
    text, meshes = scene.greeting({})
    greeting = json.loads(text)
    at, count = 4, 0
    while at < len(meshes):
        corners = 3 * struct.unpack_from("<I", meshes, at)[0]
        at += 4 + 4 * corners + 4 * -(-corners // 4)
        count += 1
    assert at == len(meshes)
    assert count == len(greeting["shapes"])
    bodies = np.zeros((greeting["bodies"], 7))
    poses = np.concatenate(scene.poses(q, values, values, bodies))
    handles = sum(len(subtask["handles"]) for subtask in greeting["subtasks"])
    assert len(poses) == 2 * greeting["joints"] + greeting["bodies"] + handles + len(
        greeting["robots"]
    )
    parents = 1 + greeting["joints"] + greeting["bodies"]
    assert all(0 <= shape["joint"] < parents for shape in greeting["shapes"])


def test_the_ghost_reaches_the_desired_values() -> None:
    """After a few frames the ghost's subtasks have their desired values."""
    scenario = load("planar_arms")
    team = scenario.build_team()
    stack = scenario.build_stack(team)
    scene, q, values = build_scene(scenario)
    desired = {name: value + 0.05 for name, value in values.items()}
    for _ in range(8):
        poses = scene.poses(q, values, desired, np.zeros((0, 7)))
    goal = np.concatenate(list(desired.values()))
    ghost = scene._kinematics.ghost(q, goal)
    found = stack.evaluate(team.state(ghost, np.zeros(team.n))).x
    np.testing.assert_allclose(found, goal, atol=1e-5)
    assert np.abs(poses[0] - poses[1]).max() > 1e-3


def test_drivable_subtasks_respect_the_block_operator() -> None:
    """All but postures are drivable, at the operator's speeds and in its workspace."""
    box = {"workspace": [0.2, 0.2], "workspace_centre": [0.0, 0.7], "linear_speed": 0.1}
    scenario = load("planar_arms", operator=box)
    stack = scenario.build_stack(scenario.build_team())
    found = drivable_subtasks(scenario, stack)
    assert list(found) == ["cooperative", "relative"]
    assert found["relative"].workspace is None
    assert found["cooperative"].workspace is not None
    assert found["cooperative"].limits[0].max() == 0.1


def test_a_relative_handle_is_at_the_first_robots_tool() -> None:
    """A cooperative handle is at its value; a relative one is rotated like its frame."""
    scenario = load("planar_arms")
    team = scenario.build_team()
    stack = scenario.build_stack(team)
    tools = team.state(team.q0, np.zeros(team.n)).tool_positions
    rotation = so3.exp(np.array([0.0, 0.0, 0.3]))
    for task in stack.subtasks:
        pose = Handles.of(task, scenario, team).poses(np.array([0.3, 0.4]), rotation, tools)[0]
        if task.name == "relative":
            np.testing.assert_allclose(pose, [*tools[0], *rotation])
        else:
            np.testing.assert_allclose(pose[:2], [0.3, 0.4])
            np.testing.assert_allclose(pose[3:], IDENTITY_ROTATION)
