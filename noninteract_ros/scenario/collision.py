# SPDX-License-Identifier: Apache-2.0
"""Collision geometry of a scenario: robots, what they hold, obstacles."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pinocchio as pin

from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import join
from noninteract_ros.simulation.environment import RigidObject, SurroundingBlock
from noninteract_ros.team.geometry.bodies import Body, convex_body, link_bodies, moved
from noninteract_ros.team.geometry.clearance import CollisionGeometry
from noninteract_ros.team.geometry.fitting import capsule_around
from noninteract_ros.team.geometry.hulls import box
from noninteract_ros.team.geometry.links import urdf_shapes
from noninteract_ros.team.geometry.obstacles import Obstacle
from noninteract_ros.team.models.registry import RobotBlock
from noninteract_ros.team.models.urdf_robot import UrdfRobot
from noninteract_ros.team.team import Team


def collision_geometry(
    robots: Mapping[str, RobotBlock], surroundings: Mapping[str, SurroundingBlock], team: Team
) -> CollisionGeometry:
    """Return the bodies of a scenario and the pairs of them that can collide.

    A link is a capsule around its collision meshes, and for robots without meshes a capsule
    between its joints. A held object moves with the tool of the first robot that holds it.

    Raises:
        ScenarioError: The meshes of a URDF cannot be read.
    """
    bodies: list[Body] = []
    for robot in team.robots:
        block, shapes = robots[robot.name], []
        if isinstance(block, UrdfRobot):
            try:
                shapes = list(urdf_shapes(block.description(robot.name), robot))
            except ValueError as error:
                path = join(robot.name, "urdf")
                raise ScenarioError(
                    path, f"a mesh ({error})", "meshes that are installed"
                ) from error
        bodies += link_bodies(robot, shapes, team)
    for name, surrounding in surroundings.items():
        if isinstance(surrounding, Obstacle):
            bodies.append(surrounding.body(name))
        elif isinstance(surrounding, RigidObject):
            bodies.append(_held(name, surrounding, team))
    return CollisionGeometry(team, bodies)


def _held(name: str, block: RigidObject, team: Team) -> Body:
    """Return a held object on the last joint of the first robot that holds it."""
    state = team.state(team.q0, np.zeros(team.n))
    numbers = [team.index(robot) for robot in block.held_by or team.names]
    centre = state.tool_positions[numbers].mean(axis=0)
    corners = box(np.array(block.size)).points
    data = team.model.createData()
    pin.forwardKinematics(team.model, data, team.q0)
    joints = [_tool_joint(team, number) for number in numbers]
    body = Body(name, name, 0, capsule_around(corners), convex_body(corners))
    pose = data.oMi[joints[0]].actInv(pin.SE3(np.eye(3), centre))
    return replace(moved(body, pose, joints[0]), touches=frozenset(joints))


def _tool_joint(team: Team, number: int) -> int:
    robot = team.robots[number]
    frame = team.model.getFrameId(f"{robot.name}/{robot.tool_frame}")
    return int(team.model.frames[frame].parentJoint)
