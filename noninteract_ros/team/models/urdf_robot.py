# SPDX-License-Identifier: Apache-2.0
"""An arm described by URDF: a file, or the text of a robot_description."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from noninteract_ros.errors import ScenarioError, one_of
from noninteract_ros.schema import join, key
from noninteract_ros.team.joint_settings import configuration_within, joint_names, per_joint
from noninteract_ros.team.models.arm_settings import ArmSettings
from noninteract_ros.team.models.urdf_files import read_urdf
from noninteract_ros.team.robot import Robot, position_limits

CLASH = " (joint)"
TOPIC = "topic:"
JOINT_TYPES = ("fixed", "revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class UrdfRobot(ArmSettings):
    """Configuration block of a robot given by URDF.

    Limits of effort, velocity and position are the URDF's unless given here; an effort or a
    velocity of 0 means no limit. Damping and friction of the URDF are not used: many files hold
    placeholders there, so friction is what the key `friction` says.
    """

    tool_frame: str = key("Link that works; it has the tool point")
    model: str = key("Kind of robot", "urdf", choices=("urdf",))
    urdf: str = key(
        "URDF file: a path, package://<package>/<path>, example-robot-data/<path>; or"
        " topic:<name>, where a robot_description is published",
        "",
    )
    urdf_text: str = key("The URDF itself, such as a robot_description, instead of a file", "")
    locked_joints: tuple[str, ...] = key("Joints that do not move", ())
    locked_positions: tuple[float, ...] = key(
        "Position of each locked joint [m or rad]; by default zeros", ()
    )

    def build(self, name: str) -> Robot:
        """The robot as a Pinocchio model without its locked joints.

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
        _check_joints(path, text, self.locked_joints)
        try:
            model = pin.buildModelFromXML(text)
        except ValueError as error:
            raise ScenarioError(path, "a URDF that the parser refuses", "a valid URDF") from error
        model.name = name
        model = _reduced(model, self.locked_joints, self._locked_configuration(name, model))
        for limits in (model.upperEffortLimit, model.upperVelocityLimit):
            limits[limits == 0.0] = np.inf
        frames = [frame.name for frame in model.frames][1:]
        if self.tool_frame not in frames:
            allowed = one_of(frames, self.tool_frame)
            raise ScenarioError(join(name, "tool_frame"), repr(self.tool_frame), allowed)
        return self.arm(name, model, self.tool_frame)

    def description(self, name: str) -> str:
        """The URDF as it was given, in the frame of its base.

        Raises:
            ScenarioError: The file cannot be read, or the topic's text is not in `urdf_text`.
        """
        path = join(name, "urdf")
        if not self._on_topic:
            return read_urdf(path, self.urdf) if self.urdf else self.urdf_text
        if not self.urdf_text:
            allowed = "a running program, which waits for it; or what `noninteract describe` makes"
            raise ScenarioError(path, repr(self.urdf), allowed)
        return self.urdf_text

    @property
    def _on_topic(self) -> bool:
        return self.urdf.startswith(TOPIC)

    def _locked_configuration(self, name: str, model: pin.Model) -> np.ndarray:
        """Configuration of all joints in which the locked ones are where they are to be."""
        joints = joint_names(model)
        for joint in self.locked_joints:
            if joint not in joints or self.locked_joints.count(joint) > 1:
                path = join(name, "locked_joints")
                raise ScenarioError(path, repr(joint), f"each once: {one_of(joints, joint)}")
        if len(self.locked_joints) == len(joints):
            allowed = f"at least one joint that moves, of {joints}"
            raise ScenarioError(join(name, "locked_joints"), "all joints", allowed)
        path = join(name, "locked_positions")
        if self.locked_positions and not self.locked_joints:
            raise ScenarioError(path, list(self.locked_positions), "none without locked_joints")
        given = per_joint(path, self.locked_positions or (0.0,), self.locked_joints)
        places = [joints.index(joint) for joint in self.locked_joints]
        positions, limits = np.zeros(len(joints)), np.tile([[-np.inf], [np.inf]], len(joints))
        positions[places], limits[:, places] = given, position_limits(model)[:, places]
        return configuration_within(path, positions.tolist(), model, limits)


def _reduced(model: pin.Model, locked: Sequence[str], q: np.ndarray) -> pin.Model:
    """The model without the locked joints, at q; joint frames and links have different names.

    URDF allows a joint to be called as a link is. Pinocchio then finds neither; nor does it find
    a joint whose frame is called otherwise, hence the other name for both meanwhile.
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


def _check_joints(path: str, text: str, locked: Sequence[str]) -> None:
    """Refuses what is no URDF, and joints that this package cannot drive."""
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ScenarioError(path, f"text that is no XML ({error})", "a URDF") from error
    if root.tag != "robot":
        raise ScenarioError(path, f"XML with the root <{root.tag}>", "a URDF: <robot> ...")
    if any("xacro" in element.tag for element in root.iter()):
        raise ScenarioError(path, "unexpanded xacro", "a URDF, as the program xacro makes it")
    for joint in root.findall("joint"):
        name, kind = joint.get("name", ""), joint.get("type", "")
        if kind not in JOINT_TYPES:
            found = f"joint {name!r} of type {kind!r}"
            raise ScenarioError(path, found, f"joints of type {' | '.join(JOINT_TYPES)}")
        mimicked = joint.find("mimic")
        if mimicked is not None and name not in locked:
            found = f"joint {name!r}, which mimics {mimicked.get('joint')!r}"
            raise ScenarioError(path, found, "joints that move by themselves, or locked_joints")
