# SPDX-License-Identifier: Apache-2.0
"""What can be driven, where its handles are, and what the page is told to draw."""

import json
import struct

import numpy as np
import pytest
from repository import ROOT

from noninteract_ros.console.drive import NO_TURN
from noninteract_ros.console.handles import Handles, drivables
from noninteract_ros.console.stage import Stage
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import read_parameters
from noninteract_ros.subtasks import so3


def load(name: str, **changes: object) -> Scenario:
    return Scenario.from_dict(read_parameters(ROOT / "config" / f"{name}.yaml") | changes)


def stage_of(scenario: Scenario) -> tuple[Stage, np.ndarray, dict[str, np.ndarray]]:
    """A stage, and where its team and its subtasks are at the start."""
    team = scenario.build_team()
    stack = scenario.build_stack(team)
    x = stack.evaluate(team.state(team.q0, np.zeros(team.n))).x
    values = {name: x[part] for name, part in zip(stack.names, stack.value_slices, strict=True)}
    return Stage(scenario, team, stack), team.q0, values


@pytest.mark.parametrize("name", ["paper", "planar_arms", "carry", "door", "wall", "formation"])
def test_the_greeting_fits_the_pictures(name: str) -> None:
    """Meshes are as many as shapes, and poses as many as the page has things to place."""
    stage, q, values = stage_of(load(name))
    text, meshes = stage.greeting({})
    told = json.loads(text)
    at, count = 4, 0
    while at < len(meshes):
        corners = 3 * struct.unpack_from("<I", meshes, at)[0]
        at += 4 + 4 * corners + 4 * -(-corners // 4)
        count += 1
    assert at == len(meshes)
    assert count == len(told["shapes"])
    bodies = np.zeros((told["bodies"], 7))
    poses = np.concatenate(stage.poses(q, values, values, bodies))
    handles = sum(len(subtask["handles"]) for subtask in told["subtasks"])
    assert len(poses) == 2 * told["joints"] + told["bodies"] + handles + len(told["robots"])
    places = 1 + told["joints"] + told["bodies"]
    assert all(0 <= shape["joint"] < places for shape in told["shapes"])


def test_the_ghost_is_where_the_references_are() -> None:
    """After a few pictures the ghost's subtasks have their desired values."""
    scenario = load("planar_arms")
    team = scenario.build_team()
    stack = scenario.build_stack(team)
    stage, q, values = stage_of(scenario)
    wanted = {name: value + 0.05 for name, value in values.items()}
    for _ in range(8):
        poses = stage.poses(q, values, wanted, np.zeros((0, 7)))
    goal = np.concatenate(list(wanted.values()))
    ghost = stage._view.ghost(q, goal)
    found = stack.evaluate(team.state(ghost, np.zeros(team.n))).x
    np.testing.assert_allclose(found, goal, atol=1e-5)
    assert np.abs(poses[0] - poses[1]).max() > 1e-3


def test_postures_are_not_driven_and_the_workspace_is_the_operators() -> None:
    """Every subtask with a place can be driven, at the operator's speeds and in its box."""
    box = {"workspace": [0.2, 0.2], "workspace_centre": [0.0, 0.7], "linear_speed": 0.1}
    scenario = load("planar_arms", operator=box)
    stack = scenario.build_stack(scenario.build_team())
    found = drivables(scenario, stack)
    assert list(found) == ["cooperative", "relative"]
    assert found["relative"].workspace is None
    assert found["cooperative"].workspace is not None
    assert found["cooperative"].limits[0].max() == 0.1


def test_a_relative_handle_is_at_the_first_robots_tool() -> None:
    """And a cooperative one where its value is; both turned as their frames are."""
    scenario = load("planar_arms")
    team = scenario.build_team()
    stack = scenario.build_stack(team)
    tools = team.state(team.q0, np.zeros(team.n)).tool_positions
    turn = so3.exp(np.array([0.0, 0.0, 0.3]))
    for task in stack.subtasks:
        pose = Handles.of(task, scenario, team).poses(np.array([0.3, 0.4]), turn, tools)[0]
        if task.name == "relative":
            np.testing.assert_allclose(pose, [*tools[0], *turn])
        else:
            np.testing.assert_allclose(pose[:2], [0.3, 0.4])
            np.testing.assert_allclose(pose[3:], NO_TURN)
