# SPDX-License-Identifier: Apache-2.0
"""Arm described by URDF: a file, or the text of a robot_description."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from noninteract_ros.errors import ScenarioError, one_of
from noninteract_ros.schema import join, key
from noninteract_ros.team.joint_settings import configuration_within, joint_names, per_joint
from noninteract_ros.team.models.arm_settings import ArmSettings
from noninteract_ros.team.models.urdf_check import check_urdf
from noninteract_ros.team.models.urdf_files import read_urdf
from noninteract_ros.team.robot import Robot, position_limits

CLASH = " (joint)"
TOPIC = "topic:"


@dataclass(frozen=True)
class UrdfRobot(ArmSettings):
    """Configuration block of a robot given by URDF.

    Limits of effort, velocity and position are those of the URDF unless given here; an effort or
    velocity limit of 0 means no limit. Damping and friction of the URDF are not used, since many
    files hold placeholders there; the key `friction` sets the friction.
    """

    tool_frame: str = key("Link of the URDF that is the tool frame")
    model: str = key("Robot model", "urdf", choices=("urdf",))
    urdf: str = key(
        "URDF file: a path, package://<package>/<path>, example-robot-data/<path>; or"
        " topic:<name>, a topic that publishes the robot_description",
        "",
    )
    urdf_text: str = key("URDF as text, such as a robot_description, instead of a file", "")
    locked_joints: tuple[str, ...] = key("Joints that are held fixed", ())
    locked_positions: tuple[float, ...] = key(
        "Position of each locked joint [m or rad]; by default zeros", ()
    )

    def build(self, name: str) -> Robot:
        """Return the robot as a Pinocchio model without its locked joints.

        Raises:
            ScenarioError: The URDF cannot be used, or a key does not fit it.
        """
        if bool(self.urdf) == bool(self.urdf_text) and not self._on_topic:
            found = "both" if self.urdf else "neither"
            raise ScenarioError(
                join(name, "urdf"), f"{found} of urdf and urdf_text", "one of them"
            )
        path = join(name, "urdf" if self.urdf else "urdf_text")
        text = self.description(name)
        check_urdf(path, text, self.locked_joints)
        try:
            model = pin.buildModelFromXML(text)
        except (ArithmeticError, LookupError, RuntimeError, ValueError) as error:
            raise ScenarioError(path, "a URDF that cannot be parsed", "a valid URDF") from error
        model.name = name
        model = _reduced(model, self.locked_joints, self._locked_configuration(name, model))
        for limits in (model.upperEffortLimit, model.upperVelocityLimit):
            limits[limits == 0.0] = np.inf
        frames = sorted(frame.name for frame in list(model.frames)[1:])
        if self.tool_frame not in frames:
            allowed = one_of(frames, self.tool_frame)
            raise ScenarioError(join(name, "tool_frame"), repr(self.tool_frame), allowed)
        return self.robot(name, model, self.tool_frame)

    def description(self, name: str) -> str:
        """Return the URDF as given, in the frame of the base.

        Raises:
            ScenarioError: The file cannot be read, or no text was received from the topic.
        """
        path = join(name, "urdf")
        if not self._on_topic:
            return read_urdf(path, self.urdf) if self.urdf else self.urdf_text
        if not self.urdf_text:
            allowed = "a running node, which waits for it, or a file by `noninteract describe`"
            raise ScenarioError(path, repr(self.urdf), allowed)
        return self.urdf_text

    @property
    def _on_topic(self) -> bool:
        return self.urdf.startswith(TOPIC)

    def _locked_configuration(self, name: str, model: pin.Model) -> np.ndarray:
        """Return a configuration of all joints with the locked ones at their positions."""
        joints = joint_names(model)
        for joint in self.locked_joints:
            if joint not in joints or self.locked_joints.count(joint) > 1:
                path = join(name, "locked_joints")
                raise ScenarioError(
                    path, repr(joint), f"each once: {one_of(sorted(joints), joint)}"
                )
        if len(self.locked_joints) == len(joints):
            allowed = f"at least one movable joint, of {joints}"
            raise ScenarioError(join(name, "locked_joints"), "all joints", allowed)
        path = join(name, "locked_positions")
        if self.locked_positions and not self.locked_joints:
            raise ScenarioError(path, list(self.locked_positions), "none without locked_joints")
        given = per_joint(path, self.locked_positions or (0.0,), self.locked_joints)
        locked = [joints.index(joint) for joint in self.locked_joints]
        positions, limits = np.zeros(len(joints)), np.tile([[-np.inf], [np.inf]], len(joints))
        positions[locked], limits[:, locked] = given, position_limits(model)[:, locked]
        return configuration_within(path, positions.tolist(), model, limits)


def _reduced(model: pin.Model, locked: Sequence[str], q: np.ndarray) -> pin.Model:
    """Return the model without the locked joints, fixed at q.

    URDF allows a joint and a link of the same name. Pinocchio then finds neither by name, nor a
    joint whose frame has another name. Joint and frame are therefore renamed together meanwhile;
    in the result, joint frames and links have different names.
    """
    links = {frame.name for frame in model.frames if frame.type == pin.FrameType.BODY}
    for frame in list(model.frames)[1:]:
        if frame.type != pin.FrameType.BODY and frame.name in links:
            frame.name += CLASH
    for joint in range(1, model.njoints):
        model.names[joint] += CLASH if model.names[joint] in links else ""
    numbers = [
        index for index, name in enumerate(model.names) if name.removesuffix(CLASH) in locked
    ]
    reduced = pin.buildReducedModel(model, numbers, q) if numbers else model
    for joint in range(1, reduced.njoints):
        reduced.names[joint] = reduced.names[joint].removesuffix(CLASH)
    return reduced
