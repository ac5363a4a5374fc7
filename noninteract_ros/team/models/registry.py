# SPDX-License-Identifier: Apache-2.0
"""Robot models that a scenario can name."""

from typing import Protocol

from noninteract_ros.team.models.planar_arm import PlanarArm
from noninteract_ros.team.models.point_mass import PointMass
from noninteract_ros.team.models.urdf_robot import UrdfRobot
from noninteract_ros.team.robot import Robot
from noninteract_ros.team.robot_topics import RobotTopics


class RobotBlock(Protocol):
    """Configuration block of one robot: a dataclass of `schema.key` fields that builds it."""

    def build(self, name: str) -> Robot:
        """Return the robot."""

    def description(self, name: str) -> str:
        """Return the URDF in the frame of the base."""

    @property
    def topics(self) -> RobotTopics:
        """Topics of the robot."""


ROBOT_MODELS: dict[str, type[RobotBlock]] = {
    "point_mass": PointMass,
    "planar_arm": PlanarArm,
    "urdf": UrdfRobot,
}
