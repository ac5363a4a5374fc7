# SPDX-License-Identifier: Apache-2.0
"""What stands around a team without moving, and who is tied to whom."""

from typing import Any

from noninteract_ros.scenario import Scenario
from noninteract_ros.simulation.environment import Wall
from noninteract_ros.subtasks.kinds.edges import edge_indices, edge_pairs
from noninteract_ros.team.team import Team


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
            found += edge_indices(edge_pairs(name, given, team), team)
    return sorted(set(found))
