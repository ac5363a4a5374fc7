# SPDX-License-Identifier: Apache-2.0
"""Robot weights and alignment of the cooperative subtasks."""

from collections.abc import Sequence

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import ScenarioError
from noninteract_ros.team.team import Team

WEIGHTS_DOC = "Weight of each robot, normalised to a sum of 1; by default equal"
ALIGNMENT_DOC = (
    "Reference of the tool orientations: tools, the tool frames themselves, or start, the initial"
    " orientations of the tools, for tools that face each other"
)


def mean_weights(name: str, weights: Sequence[float], team: Team) -> Array:
    """Return the weights of the robots with sum 1, shape (N,); by default, equal weights.

    Raises:
        ScenarioError: The count does not fit the team, or no weight is positive.
    """
    count = len(team.robots)
    found = np.array(weights or (1.0,) * count)
    if found.shape != (count,) or found.sum() <= 0.0:
        allowed = f"{count} numbers, one per robot {list(team.names)}, with a positive sum"
        raise ScenarioError(f"{name}.weights", list(weights), allowed)
    return found / found.sum()
