# SPDX-License-Identifier: Apache-2.0
"""Planar serial arm, built from link lengths and masses."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import key
from noninteract_ros.team.models.arm_settings import ArmSettings
from noninteract_ros.team.models.urdf_text import urdf_text
from noninteract_ros.team.robot import AXES, Robot

TOOL = "tool"


@dataclass(frozen=True)
class PlanarArm(ArmSettings):
    """Configuration block of a planar arm.

    At position zero all links lie along the first axis of the plane; joints rotate towards the
    second one. The joints are named joint_1, joint_2, ...; the tool is the end of the last link.
    """

    link_lengths: tuple[float, ...] = key("Length of each link [m]", positive=True)
    link_masses: tuple[float, ...] = key("Mass of each link [kg]", positive=True)
    model: str = key("Robot model", "planar_arm", choices=("planar_arm",))
    mass_location: str = key(
        "Mass distribution of a link: rod, a thin uniform rod, or tip, a point mass at its end",
        "rod",
        choices=("rod", "tip"),
    )
    plane: str = key(
        "Plane of the motion in axes of the base; horizontal is xy, if gravity acts along -z",
        "xy",
        choices=("xy", "xz", "yz"),
    )

    def build(self, name: str) -> Robot:
        """Return the robot as a Pinocchio model.

        Raises:
            ScenarioError: The lists differ in length, or a key does not fit the model.
        """
        count = len(self.link_lengths)
        if not count:
            raise ScenarioError(f"{name}.link_lengths", "an empty list", "1 or more numbers")
        if len(self.link_masses) != count:
            allowed = f"{count} numbers, one per link"
            raise ScenarioError(f"{name}.link_masses", list(self.link_masses), allowed)
        model = pin.Model()
        model.name = name
        parent, place = 0, pin.SE3(_plane_rotation(self.plane), np.zeros(3))
        links = zip(self.link_lengths, self.link_masses, strict=True)
        for number, (length, mass) in enumerate(links, start=1):
            parent = model.addJoint(parent, pin.JointModelRZ(), place, f"joint_{number}")
            model.addJointFrame(parent)  # Point of application of pushes.
            model.appendBodyToJoint(parent, self._body(length, mass), pin.SE3.Identity())
            place = pin.SE3(np.eye(3), np.array([length, 0.0, 0.0]))
        model.addFrame(pin.Frame(TOOL, parent, place, pin.FrameType.OP_FRAME))
        return self.robot(name, model, TOOL)

    def description(self, name: str) -> str:
        """Return the URDF in the frame of the base."""
        return urdf_text(self.build(name))

    def _body(self, length: float, mass: float) -> pin.Inertia:
        """Return the inertia of a link along x from its joint."""
        if self.mass_location == "tip":
            return pin.Inertia(mass, np.array([length, 0.0, 0.0]), np.zeros((3, 3)))
        across = mass * length**2 / 12.0
        return pin.Inertia(
            mass, np.array([0.5 * length, 0.0, 0.0]), np.diag([0.0, across, across])
        )


def _plane_rotation(plane: str) -> np.ndarray:
    """Return the rotation that maps x and y to the axes of a plane."""
    first, second = (np.eye(3)[AXES.index(axis)] for axis in plane)
    return np.column_stack([first, second, np.cross(first, second)])
