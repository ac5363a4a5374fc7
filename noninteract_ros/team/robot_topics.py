# SPDX-License-Identifier: Apache-2.0
"""On which topics a robot of its own speaks and listens."""

from collections.abc import Sequence
from dataclasses import dataclass

from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import join, key


@dataclass(frozen=True, kw_only=True)
class RobotTopics:
    """Keys of a robot that has topics of its own, as robots under ros2_control have.

    A topic that begins with / is taken as it is; any other lies in the programs' namespace. The
    driver calls a joint `joint_prefix` and then as the model does.
    """

    joint_states_topic: str = key(
        "JointState topic of this robot; empty: the team's joint_states. All robots or none", ""
    )
    joint_prefix: str = key("What its driver puts before the model's joint names", "")
    joint_states_rate: float = key(
        "How often robot_team speaks on joint_states_topic in wall time [Hz]; 0: at every tick",
        0.0,
        minimum=0.0,
    )
    effort_topic: str = key(
        "Float64MultiArray topic of its effort controller; empty: the team's joint_commands", ""
    )
    effort_joints: tuple[str, ...] = key(
        "Joints of the effort controller in its order, as its driver calls them; by default the"
        " model's order",
        (),
    )
    gravity_compensated: bool = key(
        "Whether the robot adds gravity torque by itself, so that effort_topic has none", False
    )

    @property
    def topics(self) -> "RobotTopics":
        """These keys, of a block that has others too."""
        return self

    def driver_joints(self, joints: Sequence[str]) -> list[str]:
        """What the driver calls the joints of the model."""
        return [self.joint_prefix + joint for joint in joints]

    def effort_order(self, joints: Sequence[str]) -> list[int]:
        """Place in the model's order of each number on `effort_topic`."""
        known = self.driver_joints(joints)
        return [known.index(joint) for joint in self.effort_joints or known]

    def check_topics(self, name: str, joints: Sequence[str]) -> None:
        """Checks the keys against the joints of a model.

        Raises:
            ScenarioError: A key asks for another one, or the effort controller has other joints.
        """
        needs = {
            "joint_states_topic": ("joint_states_rate",),
            "effort_topic": ("effort_joints", "gravity_compensated"),
        }
        for topic, keys in needs.items():
            for entry in keys:
                if getattr(self, entry) and not getattr(self, topic):
                    raise ScenarioError(join(name, entry), f"no {topic}", f"only with {topic}")
        if self.joint_prefix and not (self.joint_states_topic or self.effort_topic):
            path, allowed = join(name, "joint_prefix"), "only with topics of its own"
            raise ScenarioError(path, repr(self.joint_prefix), allowed)
        known = self.driver_joints(joints)
        if self.effort_joints and sorted(self.effort_joints) != sorted(known):
            allowed = f"each once, in any order: {known}"
            raise ScenarioError(join(name, "effort_joints"), list(self.effort_joints), allowed)
