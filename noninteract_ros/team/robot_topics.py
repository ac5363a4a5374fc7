# SPDX-License-Identifier: Apache-2.0
"""Topics of robots with drivers of their own."""

from collections.abc import Sequence
from dataclasses import dataclass

from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import join, key


@dataclass(frozen=True, kw_only=True)
class RobotTopics:
    """Topic keys of a robot with a driver of its own, such as a robot under ros2_control.

    A topic name that begins with / is absolute; any other is relative to the nodes' namespace. In
    the driver's messages, joint names are `joint_prefix` followed by the model's names.
    """

    joint_states_topic: str = key(
        "JointState topic of this robot, set for all robots or for none; empty: the team's"
        " joint_states",
        "",
    )
    joint_prefix: str = key("Prefix of the model's joint names in the driver's messages", "")
    joint_states_rate: float = key(
        "Publishing rate of robot_team on joint_states_topic in wall time [Hz]; 0: every tick",
        0.0,
        minimum=0.0,
    )
    effort_topic: str = key(
        "Float64MultiArray topic of the robot's effort controller; empty: the team's"
        " joint_commands",
        "",
    )
    effort_joints: tuple[str, ...] = key(
        "Joints of the effort controller in its order, by the driver's names; by default the"
        " model's order",
        (),
    )
    gravity_compensated: bool = key(
        "Gravity compensation by the robot itself: efforts are sent without gravity torque", False
    )

    @property
    def topics(self) -> "RobotTopics":
        """Topic keys of a block that has other keys as well."""
        return self

    def driver_joints(self, joints: Sequence[str]) -> list[str]:
        """Return the driver's names of the model's joints."""
        return [self.joint_prefix + joint for joint in joints]

    def effort_order(self, joints: Sequence[str]) -> list[int]:
        """Return the model's joint index of each number on `effort_topic`."""
        known = self.driver_joints(joints)
        return [known.index(joint) for joint in self.effort_joints or known]

    def check_topics(self, name: str, joints: Sequence[str]) -> None:
        """Check the keys against the joints of a model.

        Raises:
            ScenarioError: A key requires another one that is not set, or the joints of the effort
                controller are not those of the model.
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
            path = join(name, "joint_prefix")
            allowed = "only with joint_states_topic or effort_topic"
            raise ScenarioError(path, repr(self.joint_prefix), allowed)
        known = self.driver_joints(joints)
        if self.effort_joints and sorted(self.effort_joints) != sorted(known):
            allowed = f"each once, in any order: {known}"
            raise ScenarioError(join(name, "effort_joints"), list(self.effort_joints), allowed)
