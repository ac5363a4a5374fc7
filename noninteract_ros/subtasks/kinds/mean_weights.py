# SPDX-License-Identifier: Apache-2.0
"""What the cooperative subtasks share: the weights of the robots."""

from collections.abc import Sequence

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import ScenarioError
from noninteract_ros.team.team import Team

WEIGHTS_DOC = "Weight of each robot, normalised to sum 1; by default equal"
ALIGNMENT_DOC = (
    "tools: orientations of the tool frames as they are; start: counted from where they are at"
    " the start, for tools that face each other"
)


def mean_weights(name: str, weights: Sequence[float], team: Team) -> Array:
    """Weights of the robots with sum 1, shape (N,); without any, equal ones.

    Raises:
        ScenarioError: They do not fit the team, or there is no positive one.
    """
    count = len(team.robots)
    found = np.array(weights or (1.0,) * count)
    if found.shape != (count,) or found.sum() <= 0.0:
        allowed = f"{count} numbers, one per robot {list(team.names)}, with a positive sum"
        raise ScenarioError(f"{name}.weights", list(weights), allowed)
    return found / found.sum()
