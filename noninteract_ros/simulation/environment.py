# SPDX-License-Identifier: Apache-2.0
"""Environment of a team in a scenario: rigid objects, walls, doors."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pinocchio as pin

from noninteract_ros.arrays import Array
from noninteract_ros.errors import ScenarioError, one_of
from noninteract_ros.schema import join, key
from noninteract_ros.simulation.contact import Coupling, Grip, WallContact
from noninteract_ros.team.geometry.obstacles import OBSTACLES
from noninteract_ros.team.team import Team


@dataclass(frozen=True)
class RigidObject:
    """Configuration block of a rigid body held by robots through compliant grips.

    The body starts at the mean of the tool points of the robots that hold it. The grips start
    without strain.
    """

    kind: str = key("Kind of the environment element", choices=("rigid_object",))
    mass: float = key("Mass [kg]", positive=True)
    size: tuple[float, ...] = key("Edge lengths of a box of uniform density [m]", (0.4, 0.1, 0.1))
    held_by: tuple[str, ...] = key("Robots that hold it; by default all", ())
    stiffness: float = key("Translational stiffness of a grip [N/m]", 2000.0, minimum=0.0)
    damping: float = key("Translational damping of a grip [N s/m]", 40.0, minimum=0.0)
    rotational_stiffness: float = key("Rotational stiffness [N m/rad]", 0.0, minimum=0.0)
    rotational_damping: float = key("Rotational damping [N m s/rad]", 0.0, minimum=0.0)

    def build(self, name: str, team: Team) -> tuple[list[pin.Model], list[Coupling]]:
        """Build the model of the body and its grips.

        Raises:
            ScenarioError: A robot is unknown, or the size is not 3 positive numbers.
        """
        if len(self.size) != 3 or min(self.size) <= 0.0:
            raise ScenarioError(join(name, "size"), list(self.size), "3 numbers > 0")
        tools = _tool_placements(name, "held_by", self.held_by or team.names, team)
        centre = np.mean([tool.translation for tool in tools.values()], axis=0)
        model = pin.Model()
        joint = model.addJoint(
            0, pin.JointModelFreeFlyer(), pin.SE3(np.eye(3), centre), f"{name}/pose"
        )
        body = pin.Inertia.FromBox(self.mass, *self.size)
        model.appendBodyToJoint(joint, body, pin.SE3.Identity())
        start = pin.SE3(np.eye(3), centre)
        grips: list[Coupling] = []
        for robot, tool in tools.items():
            frame = f"{name}/grip_{robot}"
            model.addFrame(pin.Frame(frame, joint, start.actInv(tool), pin.FrameType.OP_FRAME))
            grips.append(
                Grip(
                    frames=(_tool_name(team, robot), frame),
                    stiffness=self.stiffness,
                    damping=self.damping,
                    rotational_stiffness=self.rotational_stiffness,
                    rotational_damping=self.rotational_damping,
                )
            )
        return [model], grips


@dataclass(frozen=True)
class Door:
    """Configuration block of a hinged body, held by robots at their initial tool points."""

    kind: str = key("Kind of the environment element", choices=("door",))
    hinge: tuple[float, ...] = key("A point of the hinge [m]")
    inertia: float = key("Moment of inertia about the hinge [kg m^2]", positive=True)
    axis: tuple[float, ...] = key("Direction of the hinge", (0.0, 0.0, 1.0))
    hinge_damping: float = key("Damping of the hinge [N m s/rad]", 0.0, minimum=0.0)
    held_by: tuple[str, ...] = key("Robots that hold it; by default all", ())
    stiffness: float = key("Stiffness of a grip [N/m]", 5000.0, minimum=0.0)
    damping: float = key("Damping of a grip [N s/m]", 50.0, minimum=0.0)

    def build(self, name: str, team: Team) -> tuple[list[pin.Model], list[Coupling]]:
        """Build the model of the door and its grips.

        Raises:
            ScenarioError: A robot is unknown, or the hinge or the axis is not a valid vector.
        """
        hinge = _vector(join(name, "hinge"), self.hinge)
        axis = _unit(join(name, "axis"), self.axis)
        tools = _tool_placements(name, "held_by", self.held_by or team.names, team)
        model = pin.Model()
        joint = model.addJoint(
            0, pin.JointModelRevoluteUnaligned(axis), pin.SE3(np.eye(3), hinge), f"{name}/hinge"
        )
        # Only the moment about the axis matters for a hinge.
        body = pin.Inertia(1e-6, np.zeros(3), self.inertia * np.eye(3))
        model.appendBodyToJoint(joint, body, pin.SE3.Identity())
        model.damping[:] = self.hinge_damping
        grips: list[Coupling] = []
        for robot, tool in tools.items():
            frame, place = f"{name}/handle_{robot}", pin.SE3(np.eye(3), tool.translation - hinge)
            model.addFrame(pin.Frame(frame, joint, place, pin.FrameType.OP_FRAME))
            grips.append(Grip((_tool_name(team, robot), frame), self.stiffness, self.damping))
        return [model], grips


@dataclass(frozen=True)
class Wall:
    """Configuration block of a flat wall in contact with tools."""

    kind: str = key("Kind of the environment element", choices=("wall",))
    point: tuple[float, ...] = key("A point of the wall [m]")
    normal: tuple[float, ...] = key("Normal, away from the wall")
    stiffness: float = key("Stiffness [N/m]", 10000.0, positive=True)
    damping: float = key("Hunt-Crossley damping [s/m]", 1.0, minimum=0.0)
    touched_by: tuple[str, ...] = key("Robots whose tools can touch it; by default all", ())

    def build(self, name: str, team: Team) -> tuple[list[pin.Model], list[Coupling]]:
        """Build a contact for each tool; a wall has no body.

        Raises:
            ScenarioError: A robot is unknown, or the point or the normal is not a valid vector.
        """
        point = _vector(join(name, "point"), self.point)
        normal = _unit(join(name, "normal"), self.normal)
        touching = self.touched_by or team.names
        _tool_placements(name, "touched_by", touching, team)
        return [], [
            WallContact((_tool_name(team, robot),), point, normal, self.stiffness, self.damping)
            for robot in touching
        ]


class SurroundingBlock(Protocol):
    """Configuration block of an element of the environment."""

    def build(self, name: str, team: Team) -> tuple[list[pin.Model], list[Coupling]]:
        """Build the models of its bodies and its couplings with the team."""


SURROUNDINGS: dict[str, type[SurroundingBlock]] = {
    "rigid_object": RigidObject,
    "door": Door,
    "wall": Wall,
    **OBSTACLES,
}


def _tool_name(team: Team, robot: str) -> str:
    return f"{robot}/{team.robots[team.index(robot)].tool_frame}"


def _tool_placements(
    name: str, item: str, robots: tuple[str, ...], team: Team
) -> dict[str, pin.SE3]:
    """Return the initial tool placements of robots, by name."""
    state = team.state(team.q0, np.zeros(team.n))
    rotations = team.tool_rotations(team.q0)
    placements = {}
    for robot in robots:
        if robot not in team.names:
            raise ScenarioError(join(name, item), repr(robot), one_of(team.names, robot))
        index = team.index(robot)
        placements[robot] = pin.SE3(rotations[index], state.tool_positions[index])
    return placements


def _vector(path: str, values: tuple[float, ...]) -> Array:
    if len(values) != 3:
        raise ScenarioError(path, list(values), "3 numbers")
    return np.array(values)


def _unit(path: str, values: tuple[float, ...]) -> Array:
    vector = _vector(path, values)
    length = float(np.linalg.norm(vector))
    if length < 1e-9:
        raise ScenarioError(path, list(values), "3 numbers, not all zero")
    return vector / length
