# SPDX-License-Identifier: Apache-2.0
"""The URDF of generated robots, read back: the same robot."""

import numpy as np
import pytest

from noninteract_ros.schema import load
from noninteract_ros.team.models.planar_arm import PlanarArm
from noninteract_ros.team.models.point_mass import PointMass
from noninteract_ros.team.models.registry import RobotBlock
from noninteract_ros.team.models.urdf_robot import UrdfRobot
from noninteract_ros.team.robot import Robot
from noninteract_ros.team.team import Team

THREE_LINKS = {"link_lengths": [0.7, 0.4, 0.2], "link_masses": [3.0, 1.2, 0.4]}
BLOCKS: dict[str, RobotBlock] = {
    "rods": load(PlanarArm, THREE_LINKS | {"plane": "xz"}),
    "tips": load(PlanarArm, THREE_LINKS | {"mass_location": "tip", "plane": "yz"}),
    "limited": load(
        PlanarArm,
        THREE_LINKS | {"lower_limit": [-1.5], "upper_limit": [2.5], "effort_limit": [40.0]},
    ),
    "ball": load(PointMass, {"mass": 2.0, "axes": ["z", "x"]}),
    "fast_ball": load(PointMass, {"mass": 2.0, "velocity_limit": [3.0], "upper_limit": [4.0]}),
}


def read_back(block: RobotBlock) -> Robot:
    tool = block.build("arm").tool_frame
    return load(UrdfRobot, {"urdf_text": block.description("arm"), "tool_frame": tool}).build(
        "arm"
    )


@pytest.mark.parametrize("name", BLOCKS)
def test_the_same_robot_is_read_back(name: str) -> None:
    """Joint names, inertia, Coriolis terms, gravity, tool and limits agree at random states."""
    made, read = BLOCKS[name].build("arm"), read_back(BLOCKS[name])
    assert list(read.model.names) == list(made.model.names)
    other = BLOCKS["rods"].build("other")
    teams = [Team([robot, other]) for robot in (made, read)]
    rng = np.random.default_rng(3)
    for _ in range(20):
        positions, v = rng.uniform(-1.5, 1.5, (2, teams[0].n))
        states = [team.state(team.configuration_from_joints(positions), v) for team in teams]
        for quantity in ("M", "C", "g", "tool_positions", "tool_rotations", "tool_jacobians"):
            expected, found = (getattr(state, quantity) for state in states)
            np.testing.assert_allclose(found, expected, atol=1e-12, err_msg=quantity)
    np.testing.assert_array_equal(read.effort_limits, made.effort_limits)
    np.testing.assert_array_equal(read.velocity_limits, made.velocity_limits)
    if name == "limited":
        np.testing.assert_array_equal(read.position_limits, made.position_limits)


def test_every_link_with_mass_can_be_seen() -> None:
    """Each link has a rod and a sphere; a point mass is one sphere."""
    assert BLOCKS["rods"].description("arm").count("<visual>") == 6
    assert BLOCKS["ball"].description("ball").count("<sphere") == 1
    assert BLOCKS["ball"].description("ball").count("<cylinder") == 0


def test_a_given_urdf_is_returned_unchanged() -> None:
    """Not a byte is changed, so that a reader can compare it."""
    text = BLOCKS["rods"].description("arm")
    block = load(UrdfRobot, {"urdf_text": text, "tool_frame": "tool"})
    assert block.description("other name") == text
