# SPDX-License-Identifier: Apache-2.0
"""Chosen joints, so that redundant arms have no internal motion left: assumption 2."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import ScenarioError, one_of
from noninteract_ros.schema import key
from noninteract_ros.subtasks.kinds.edges import NO_SUBTASKS
from noninteract_ros.subtasks.mixing import JointMixing
from noninteract_ros.subtasks.subtask import Subtask, SubtaskState
from noninteract_ros.team.team import Team, TeamState


@dataclass(frozen=True)
class Posture:
    """Configuration block of the posture subtask.

    Its elements are the joints; messages carry a joint's coordinate [m or rad] as the x of its
    translation.
    """

    kind: str = key("Kind of subtask", choices=("posture",))
    joints: tuple[str, ...] = key("Joints, as <robot>/<joint>")

    def build(self, name: str, team: Team, others: Mapping[str, Subtask] = NO_SUBTASKS) -> Subtask:
        """The subtask for a team.

        Raises:
            ScenarioError: No joint, one twice, or one that the team does not have or that has no
                single coordinate (a continuous joint has a sine and a cosine).
        """
        able = {
            joint_name: (joint.idx_q, joint.idx_v)
            for joint_name, joint in zip(team.model.names, team.model.joints, strict=True)
            if joint.nq == joint.nv == 1
        }
        path = f"{name}.joints"
        if not self.joints or len(set(self.joints)) != len(self.joints):
            raise ScenarioError(path, list(self.joints), f"different ones of {one_of(able)}")
        for joint in self.joints:
            if joint not in able:
                raise ScenarioError(path, repr(joint), one_of(able, joint))
        places = [able[joint] for joint in self.joints]
        units = tuple(team.units[in_v] for _, in_v in places)
        return JointSelection(name, self.joints, places, units, team.n)


class JointSelection(Subtask):
    """Coordinates of some joints.

    Args:
        name: Name of the subtask.
        joints: Names of the joints, its elements.
        places: Place of each in the configuration and in the velocity.
        units: Unit of each.
        n: Number of velocities of the team.
    """

    def __init__(
        self,
        name: str,
        joints: tuple[str, ...],
        places: Sequence[tuple[int, int]],
        units: tuple[str, ...],
        n: int,
    ) -> None:
        self.name, self.elements, self.axes = name, joints, ("x",)
        self._in_q: Array = np.array([in_q for in_q, _ in places])
        self._J = np.eye(n)[[in_v for _, in_v in places]]
        self._J_rate = np.zeros_like(self._J)
        self.mixing = JointMixing(*zip(*places, strict=True))
        self._units = units

    @property
    def element_units(self) -> tuple[str, ...]:
        """Metres where a joint slides."""
        return self._units

    def evaluate(self, state: TeamState) -> SubtaskState:
        """Value and its constant Jacobian."""
        return SubtaskState(state.q[self._in_q], self._J, self._J_rate)
