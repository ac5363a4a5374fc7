# SPDX-License-Identifier: Apache-2.0
"""Point mass that translates along one to three axes of the world."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import join, key
from noninteract_ros.team.joint_settings import JointSettings, configuration_within
from noninteract_ros.team.models.urdf_text import urdf_text
from noninteract_ros.team.robot import AXES, Robot, position_limits

PRISMATIC = {"x": pin.JointModelPX, "y": pin.JointModelPY, "z": pin.JointModelPZ}


@dataclass(frozen=True)
class PointMass(JointSettings):
    """Configuration block of a point mass; coordinates are world positions along `axes`."""

    mass: float = key("Mass [kg]", positive=True)
    model: str = key("Robot model", "point_mass", choices=("point_mass",))
    axes: tuple[str, ...] = key("Axes of motion in the world", ("x", "y"), choices=AXES)
    initial_position: tuple[float, ...] = key(
        "Initial position along the axes [m]; by default zeros", ()
    )
    brake_damping: float = key(
        "Damping of the robot's brake, which acts while no commands arrive [N s/m]",
        20.0,
        minimum=0.0,
    )

    def build(self, name: str) -> Robot:
        """Return the robot as a Pinocchio model: a prismatic joint per axis, the mass on the last.

        Raises:
            ScenarioError: Axes repeat, or another key does not fit them.
        """
        if not self.axes or len(set(self.axes)) != len(self.axes):
            allowed = "one to three different ones of x, y, z"
            raise ScenarioError(f"{name}.axes", list(self.axes), allowed)
        model = pin.Model()
        model.name = name
        parent = 0
        for axis in self.axes:
            parent = model.addJoint(parent, PRISMATIC[axis](), pin.SE3.Identity(), axis)
        body = pin.Inertia(self.mass, np.zeros(3), np.zeros((3, 3)))
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
        model.addFrame(pin.Frame("tool", parent, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
        self.apply_to(name, model)
        path = join(name, "initial_position")
        limits = position_limits(model)
        start = configuration_within(path, self.initial_position, model, limits)
        return Robot(
            name=name,
            model=model,
            tool_frame="tool",
            initial_position=start,
            axes=self.axes,
            brake_damping=self.brake_damping,
        )

    def description(self, name: str) -> str:
        """Return the URDF in the world frame: a sphere."""
        return urdf_text(self.build(name))
