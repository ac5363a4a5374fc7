# SPDX-License-Identifier: Apache-2.0
"""URDF export of generated robots, for viewers and other programs."""

from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio as pin

from noninteract_ros.arrays import Array
from noninteract_ros.team.robot import AXES, Robot

BASE = "base_link"
UNBOUNDED = 1e6  # [m] stands for no limit: URDF has no unlimited prismatic joint
DENSITY = 2000.0  # [kg/m^3] of drawn bodies; sets their size only
MIN_RADIUS = 0.01  # [m] of a drawn link


def urdf_text(robot: Robot) -> str:
    """Return the URDF of a robot in the frame of its base: same joints, inertias, limits, tool.

    Links are drawn as rods along their length with a sphere at the end; the mass sets the radius.
    An unlimited effort or velocity is written as 0, which this package reads as no limit. Armature
    and friction are left out: they are not part of the kinematics.

    Args:
        robot: Chain of revolute joints about z and prismatic joints along axes.
    """
    model = robot.model
    root = Element("robot", name=robot.name)
    SubElement(root, "link", name=BASE)
    tool = model.frames[model.getFrameId(robot.tool_frame)]
    for joint in range(1, model.njoints):
        last = joint == model.njoints - 1
        end = (tool.placement if last else model.jointPlacements[joint + 1]).translation
        _add_link(root, f"link_{joint}", model.inertias[joint], end)
        parent = int(model.parents[joint])
        _add_joint(root, model, joint, f"link_{parent}" if parent else BASE)
    SubElement(root, "link", name=robot.tool_frame)
    fixed = SubElement(root, "joint", name=f"{robot.tool_frame}_joint", type="fixed")
    SubElement(fixed, "parent", link=f"link_{int(tool.parentJoint)}")
    SubElement(fixed, "child", link=robot.tool_frame)
    _add_origin(fixed, tool.placement.translation, tool.placement.rotation)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


def _add_joint(root: Element, model: pin.Model, joint: int, parent: str) -> None:
    kind = model.joints[joint].shortname()
    slides = "JointModelP" in kind
    axis = {"X": "1 0 0", "Y": "0 1 0", "Z": "0 0 1"}[kind[-1]]
    place, at = model.jointPlacements[joint], model.joints[joint].idx_v
    low, high = model.lowerPositionLimit[at], model.upperPositionLimit[at]
    bounded = max(-low, high) < UNBOUNDED
    name = "prismatic" if slides else "revolute" if bounded else "continuous"
    element = SubElement(root, "joint", name=model.names[joint], type=name)
    SubElement(element, "parent", link=parent)
    SubElement(element, "child", link=f"link_{joint}")
    _add_origin(element, place.translation, place.rotation)
    SubElement(element, "axis", xyz=axis)
    ends = (low, high) if bounded else (-UNBOUNDED, UNBOUNDED)
    limits = {"effort": model.upperEffortLimit[at], "velocity": model.upperVelocityLimit[at]}
    texts = {key: _text(value if value < UNBOUNDED else 0.0) for key, value in limits.items()}
    texts |= {} if name == "continuous" else {"lower": _text(ends[0]), "upper": _text(ends[1])}
    SubElement(element, "limit", texts)


def _add_link(root: Element, name: str, inertia: pin.Inertia, end: Array) -> None:
    link = SubElement(root, "link", name=name)
    if inertia.mass <= 0.0:
        return
    inertial = SubElement(link, "inertial")
    _add_origin(inertial, inertia.lever)
    SubElement(inertial, "mass", value=_text(inertia.mass))
    rotational = {
        f"i{a}{b}": _text(inertia.inertia[i, j])
        for i, a in enumerate(AXES)
        for j, b in enumerate(AXES[i:], start=i)
    }
    SubElement(inertial, "inertia", rotational)
    length = float(np.linalg.norm(end))
    if length > 0.0:
        radius = max(MIN_RADIUS, (inertia.mass / (DENSITY * np.pi * length)) ** 0.5)
        rod = SubElement(link, "visual")
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end).matrix()
        _add_origin(rod, 0.5 * end, turn)
        shape = {"radius": _text(radius), "length": _text(length)}
        SubElement(SubElement(rod, "geometry"), "cylinder", shape)
    else:
        radius = (3.0 * inertia.mass / (4.0 * np.pi * DENSITY)) ** (1.0 / 3.0)
    ball = SubElement(link, "visual")
    _add_origin(ball, end)
    SubElement(SubElement(ball, "geometry"), "sphere", radius=_text(radius))


def _add_origin(element: Element, place: Array, rotation: Array | None = None) -> None:
    angles = np.zeros(3) if rotation is None else pin.rpy.matrixToRpy(rotation)
    SubElement(element, "origin", xyz=_text(*place), rpy=_text(*angles))


def _text(*numbers: float) -> str:
    """Format numbers without loss of precision."""
    return " ".join(repr(float(number)) for number in numbers)
