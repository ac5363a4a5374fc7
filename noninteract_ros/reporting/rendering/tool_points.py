# SPDX-License-Identifier: Apache-2.0
"""Tool points of a recorded run, and the pairs of robots that its relative subtasks join."""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.reporting.recording.recorded import Recorded

SAMPLES = 1500  # states of a run at which tool points are computed


def tool_points(recorded: Recorded) -> tuple[Array, Array]:
    """Times (n,) [s] and tool points (n, N, 3) [m] at some of the states."""
    rows = np.unique(np.linspace(0, len(recorded.t) - 1, SAMPLES).astype(int))
    rest = np.zeros(recorded.team.n)
    points = [recorded.team.state(recorded.q[row], rest).tool_positions for row in rows]
    return recorded.t[rows], np.array(points)


def edges_of(recorded: Recorded) -> list[tuple[int, int]]:
    """Pairs of robots that a subtask relates to each other."""
    names = recorded.team.names
    pairs = (element.split("-") for task in recorded.stack.subtasks for element in task.elements)
    return [
        (names.index(pair[0]), names.index(pair[1]))
        for pair in pairs
        if len(pair) == 2 and set(pair) <= set(names)
    ]
