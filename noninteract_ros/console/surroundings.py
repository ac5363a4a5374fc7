# SPDX-License-Identifier: Apache-2.0
"""What stands around a team, for the page: objects, doors, walls, and who is tied to whom."""

from typing import Any

import numpy as np

from noninteract_ros.scenario import Scenario
from noninteract_ros.simulation.environment import Door, RigidObject, Wall
from noninteract_ros.subtasks.edges import edge_pairs, edge_places
from noninteract_ros.team.team import Team


def bodies(scenario: Scenario, team: Team) -> list[dict[str, Any]]:
    """Name and form of each body that moves; its pose comes with each picture."""
    found = []
    for name, block in scenario.surroundings.items():
        if isinstance(block, RigidObject):
            found.append({"name": name, "kind": "box", "size": list(block.size)})
        elif isinstance(block, Door):
            state = team.state(team.q0, np.zeros(team.n))
            held = [team.index(robot) for robot in block.held_by or team.names]
            handles = state.tool_positions[held] - np.array(block.hinge)
            axis = np.array(block.axis) / np.linalg.norm(block.axis)
            door = {"axis": axis.tolist(), "handles": handles.round(6).tolist()}
            found.append({"name": name, "kind": "door", **door})
    return found


def walls(scenario: Scenario) -> list[dict[str, Any]]:
    """Point and normal of each wall."""
    return [
        {"name": name, "point": list(block.point), "normal": list(block.normal)}
        for name, block in scenario.surroundings.items()
        if isinstance(block, Wall)
    ]


def edges(scenario: Scenario, team: Team) -> list[tuple[int, int]]:
    """Pairs of robots that a relative subtask ties together."""
    found: list[tuple[int, int]] = []
    for name, spec in scenario.subtasks.items():
        given = getattr(spec.kind, "edges", None)
        if given is not None:
            found += edge_places(edge_pairs(name, given, team), team)
    return sorted(set(found))
