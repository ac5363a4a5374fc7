# SPDX-License-Identifier: Apache-2.0
"""Pairs of robots and reference frame of the relative subtasks."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from types import MappingProxyType

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import ScenarioError, one_of
from noninteract_ros.subtasks.components import Component
from noninteract_ros.subtasks.subtask import Subtask
from noninteract_ros.team.team import Team

WORLD = "world"
NO_SUBTASKS: Mapping[str, Subtask] = MappingProxyType({})
EDGES_DOC = "Pairs of robots in sequence, each with the value first - second; by default a chain"
FRAME_DOC = (
    "Reference frame: world, or the name of a subtask listed before that has an orientation of the"
    " team, such as a cooperative_pose"
)


def edge_pairs(name: str, edges: Sequence[str], team: Team) -> list[tuple[str, str]]:
    """Return pairs of names from names in sequence; by default, a chain over the team.

    Raises:
        ScenarioError: The names are not pairs of different robots of the team.
    """
    if not edges:
        return list(pairwise(team.names))
    pairs = list(zip(edges[::2], edges[1::2], strict=False))
    known = all(robot in team.names for robot in edges)
    if len(edges) % 2 or not known or any(a == b for a, b in pairs):
        allowed = f"pairs of different robots of {list(team.names)}"
        raise ScenarioError(f"{name}.edges", list(edges), allowed)
    return pairs


def edge_names(pairs: Sequence[tuple[str, str]]) -> tuple[str, ...]:
    """Return the element names of a relative subtask."""
    return tuple(f"{first}-{second}" for first, second in pairs)


def edge_indices(pairs: Sequence[tuple[str, str]], team: Team) -> list[tuple[int, int]]:
    """Return the pairs as robot indices."""
    return [(team.index(first), team.index(second)) for first, second in pairs]


def edge_weights(pairs: Sequence[tuple[str, str]], team: Team) -> Array:
    """Return +1 for the first and -1 for the second robot of each pair, shape (pairs, N)."""
    weights = np.zeros((len(pairs), len(team.robots)))
    for row, (first, second) in zip(weights, edge_indices(pairs, team), strict=True):
        row[first], row[second] = 1.0, -1.0
    return weights


def frame_named(name: str, frame: str, others: Mapping[str, Subtask]) -> Component | None:
    """Return the rotation of a subtask's frame; None for the world.

    Args:
        name: Subtask that refers to the frame, for error messages.
        frame: `world` or the name of another subtask.
        others: Subtasks listed before, by name.

    Raises:
        ScenarioError: The subtask does not exist, or has no orientation of the team.
    """
    if frame == WORLD:
        return None
    found = others[frame].frame if frame in others else None
    if found is None:
        able = [other.name for other in others.values() if other.frame is not None]
        allowed = one_of([WORLD, *able], frame)
        raise ScenarioError(f"{name}.frame", repr(frame), allowed)
    return found
