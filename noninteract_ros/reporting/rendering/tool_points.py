# SPDX-License-Identifier: Apache-2.0
"""Tool points of a run and edges between robots."""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.reporting.recording.recorded import Recorded

SAMPLES = 1500  # states with tool points


def tool_points(recorded: Recorded) -> tuple[Array, Array]:
    """Return times (m,) [s] and tool points (m, N, 3) [m] at up to `SAMPLES` states."""
    rows = np.unique(np.linspace(0, len(recorded.t) - 1, SAMPLES).astype(int))
    rest = np.zeros(recorded.team.n)
    points = [recorded.team.state(recorded.q[row], rest).tool_positions for row in rows]
    return recorded.t[rows], np.array(points)


def edges_of(recorded: Recorded) -> list[tuple[int, int]]:
    """Return the pairs of robots that a subtask relates."""
    names = recorded.team.names
    pairs = (element.split("-") for task in recorded.stack.subtasks for element in task.elements)
    return [
        (names.index(pair[0]), names.index(pair[1]))
        for pair in pairs
        if len(pair) == 2 and set(pair) <= set(names)
    ]
