# SPDX-License-Identifier: Apache-2.0
"""Posture of chosen joints, which leaves redundant arms no internal motion: assumption 2."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import ScenarioError, one_of
from noninteract_ros.schema import key
from noninteract_ros.subtasks.kinds.edges import NO_SUBTASKS
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.mixing import JointMixing
from noninteract_ros.subtasks.subtask import Subtask, SubtaskState
from noninteract_ros.team.team import Team, TeamState


@dataclass(frozen=True)
class Posture:
    """Configuration block of the posture subtask.

    The elements are the joints; messages carry a joint's coordinate [m or rad] as the x of a
    translation.
    """

    kind: str = key("Kind of subtask", choices=("posture",))
    joints: tuple[str, ...] = key("Joints of the posture, as <robot>/<joint>")

    def build(self, name: str, team: Team, others: Mapping[str, Subtask] = NO_SUBTASKS) -> Subtask:
        """Return the subtask for a team.

        Raises:
            ScenarioError: No joint is given, a joint is repeated or does not exist.
        """
        able = dict(zip(team.joint_names, list(team.model.joints)[1:], strict=True))
        known, path = sorted(able), f"{name}.joints"
        if not self.joints or len(set(self.joints)) != len(self.joints):
            raise ScenarioError(path, list(self.joints), f"different ones of {one_of(known)}")
        for joint in self.joints:
            if joint not in able:
                raise ScenarioError(path, repr(joint), one_of(known, joint))
        joints = [able[joint] for joint in self.joints]
        indices = [(joint.idx_q, joint.idx_v) for joint in joints]
        units = tuple(team.units[in_v] for _, in_v in indices)
        continuous = tuple(joint.nq == 2 for joint in joints)
        return JointSelection(name, self.joints, indices, units, continuous, team.n)


class JointSelection(Subtask):
    """Coordinates of chosen joints; those of continuous joints are angles within (-pi, pi].

    Args:
        name: Name of the subtask.
        joints: Names of the joints, which are the elements.
        indices: Index of each joint in the configuration and in the velocity.
        units: Unit of each joint.
        continuous: True for each continuous joint, whose configuration is cosine and sine.
        n: Dimension of the team's velocity.
    """

    def __init__(
        self,
        name: str,
        joints: tuple[str, ...],
        indices: Sequence[tuple[int, int]],
        units: tuple[str, ...],
        continuous: tuple[bool, ...],
        n: int,
    ) -> None:
        self.name, self.elements, self.axes = name, joints, ("x",)
        self._in_q: Array = np.array([in_q for in_q, _ in indices])
        self._J = np.eye(n)[[in_v for _, in_v in indices]]
        self._J_rate = np.zeros_like(self._J)
        if not any(continuous):
            self.mixing = JointMixing(*zip(*indices, strict=True))
        self._units, self._continuous = units, continuous
        self._circular = np.flatnonzero(continuous)

    @cached_property
    def layout(self) -> Layout:
        """Layout of a value: one position per joint, on a circle if the joint is continuous."""
        count = len(self.elements)
        return Layout((1,) * count, (False,) * count, self._continuous)

    @property
    def element_units(self) -> tuple[str, ...]:
        """Unit of each joint: m if prismatic, rad if revolute."""
        return self._units

    def evaluate(self, state: TeamState) -> SubtaskState:
        """Return value and constant Jacobian."""
        x = state.q[self._in_q]
        if self._circular.size:
            x[self._circular] = np.arctan2(
                state.q[self._in_q[self._circular] + 1], x[self._circular]
            )
        return SubtaskState(x, self._J, self._J_rate)
