# SPDX-License-Identifier: Apache-2.0
"""Shapes of robots and surroundings: convex bodies, each fixed to a joint.

Robots from URDF have the shape of their collision geometry. Without collision geometry, and for
generated arms, each link is a capsule from its joint to the next. Point masses are spheres.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.spatial import QhullError

from noninteract_ros.errors import ScenarioError
from noninteract_ros.scenario.scenario import Scenario
from noninteract_ros.simulation.environment import Door, RigidObject
from noninteract_ros.simulation.plant import Plant
from noninteract_ros.team.geometry import hulls
from noninteract_ros.team.geometry.hulls import Hull
from noninteract_ros.team.geometry.links import link_capsules, urdf_shapes
from noninteract_ros.team.geometry.obstacles import Obstacle
from noninteract_ros.team.models.point_mass import PointMass
from noninteract_ros.team.models.urdf_robot import UrdfRobot
from noninteract_ros.team.robot import Robot

NO_ROBOT = -1
PANEL = (0.02, 0.05)  # thickness and height of a door, as shares of its width
FINE_SPHERES = 6  # largest number of point masses that are drawn with many vertices
EDGE = 0.08  # longest edge of a triangle, as a share of the scene's radius


@dataclass(frozen=True)
class Shape:
    """Convex body fixed to a joint.

    Attributes:
        joint: Index of the joint in the plant's model; 0 is the world.
        hull: Body in the joint's frame.
        owner: Index of the robot that it belongs to, or `NO_ROBOT`.
    """

    joint: int
    hull: Hull
    owner: int


def shapes_of(
    scenario: Scenario, plant: Plant, radius: float, longest: float | None = None
) -> list[Shape]:
    """Return the shapes of all robots and of the bodies around them.

    Args:
        scenario: Scenario of the run.
        plant: Team and bodies of the scenario.
        radius: Radius of the whole scene [m], which sets the size of point masses.
        longest: Longest edge of a triangle [m]; by default a share of the radius.
    """
    found: list[Shape] = []
    for number, (robot, block) in enumerate(
        zip(plant.team.robots, scenario.robots.values(), strict=True)
    ):
        parts = _point_mass(block, scenario, radius) if isinstance(block, PointMass) else []
        if isinstance(block, UrdfRobot):
            parts = list(_collision_geometry(block, robot))
        for joint, hull in parts or link_capsules(robot):
            found.append(Shape(*_in_plant(plant, robot, joint, hull), number))
    found += [
        Shape(joint, hull, NO_ROBOT)
        for name, block in scenario.surroundings.items()
        for joint, hull in _body(name, block, plant)
    ]
    edge = EDGE * radius if longest is None else longest
    return [Shape(shape.joint, shape.hull.refined(edge), shape.owner) for shape in found]


def _in_plant(plant: Plant, robot: Robot, joint: int, hull: Hull) -> tuple[int, Hull]:
    """Convert a shape on a joint of a robot's own model to one on a joint of the plant."""
    if joint == 0:
        return 0, hull.transformed(robot.base_pose)
    return plant.model.getJointId(f"{robot.name}/{robot.model.names[joint]}"), hull


def _point_mass(block: PointMass, scenario: Scenario, radius: float) -> list[tuple[int, Hull]]:
    """Return the sphere of a point mass, largest for the heaviest one."""
    masses = [item.mass for item in scenario.robots.values() if isinstance(item, PointMass)]
    share = 0.08 / np.sqrt(1.0 + 0.25 * len(masses))
    size = share * radius * (block.mass / max(masses)) ** (1.0 / 3.0)
    return [(len(block.axes), hulls.sphere(size, 60 if len(masses) <= FINE_SPHERES else 24))]


def _collision_geometry(block: UrdfRobot, robot: Robot) -> Iterator[tuple[int, Hull]]:
    """Iterate over the collision geometry by joint; empty if meshes are missing."""
    try:
        shapes = list(urdf_shapes(block.description(robot.name), robot))
    except (ScenarioError, ValueError):
        return
    for shape in shapes:
        try:
            hull = hulls.geometry_hull(shape.geometry)
        except QhullError:  # A flat mesh.
            continue
        if hull is not None:
            yield shape.joint, hull.transformed(shape.placement)


def _body(name: str, block: object, plant: Plant) -> list[tuple[int, Hull]]:
    """Return an object as a box, a door as a panel from its hinge to beyond its handles."""
    if isinstance(block, RigidObject):
        return [(plant.model.getJointId(f"{name}/pose"), hulls.box(np.array(block.size)))]
    if isinstance(block, Obstacle):
        return [(0, block.hull(name))]
    if not isinstance(block, Door):
        return []
    handles = [
        frame.placement.translation
        for frame in plant.model.frames
        if frame.name.startswith(f"{name}/handle_")
    ]
    axis = np.array(block.axis) / np.linalg.norm(block.axis)
    along = max((end - (end @ axis) * axis for end in handles), key=np.linalg.norm)
    width = float(np.linalg.norm(along)) or 1.0
    across = along / width
    thickness, height = (share * width for share in PANEL)
    place = pin.SE3(np.column_stack((across, np.cross(axis, across), axis)), 0.55 * width * across)
    panel = hulls.box(np.array([1.1 * width, thickness, height]))
    return [(plant.model.getJointId(f"{name}/hinge"), panel.transformed(place))]
