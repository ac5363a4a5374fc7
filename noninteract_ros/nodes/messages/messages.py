# SPDX-License-Identifier: Apache-2.0
"""Conversion between messages and arrays.

Received messages are checked completely; an invalid one raises an `InputError` that names the
offending field. `encode` methods return serialized bytes. An empty `frame_id` is the world frame.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs import msg as geometry
from std_msgs.msg import Float64MultiArray, MultiArrayDimension
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from noninteract_ros.arrays import Array
from noninteract_ros.errors import InputError
from noninteract_ros.nodes.messages import cdr
from noninteract_ros.nodes.messages.cdr import CdrTemplate, check_finite
from noninteract_ros.subtasks.layout import UNIT_TOLERANCE, Layout

WORLD = "world"
AXES = ("x", "y", "z")
FIELDS = {geometry.Point: AXES, geometry.Vector3: AXES, geometry.Quaternion: (*AXES, "w")}
POSE = ("x", "y", "z", "rotation x", "rotation y", "rotation z", "rotation w")
TWIST = ("x", "y", "z", "angular x", "angular y", "angular z")
WRENCH = ("force x", "force y", "force z", "torque x", "torque y", "torque z")


@dataclass(frozen=True, slots=True)
class ParsedReference:
    """Reference of a source: stamp [ns], value (size,), velocity and acceleration (dim,) or None.

    Quaternions have unit length.
    """

    stamp_ns: int
    position: Array
    velocity: Array | None
    acceleration: Array | None


@dataclass(frozen=True, slots=True)
class Marker:
    """Marker of a source that no reference follows up to and including this stamp [ns]."""

    stamp_ns: int


def stamp_ns(stamp: Time) -> int:
    """Return the nanoseconds of a stamp; raise an InputError if it is not a time."""
    return cdr.join_stamp(stamp.sec, stamp.nanosec)


def to_stamp(time_ns: int) -> Time:
    """Return the stamp of a time [ns]."""
    sec, nanosec = divmod(time_ns, cdr.SECOND)
    return Time(sec=sec, nanosec=nanosec)


def check_frame(frame_id: str, *allowed: str) -> None:
    """Raise an InputError unless the frame is empty or one of the allowed frames."""
    if frame_id and frame_id not in allowed:
        raise InputError(f"frame {frame_id[:80]!r} is unknown, allowed: {' | '.join(allowed)}")


def check_rotations(rotations: Array, names: Sequence[str]) -> None:
    """Raise an InputError unless all quaternions, shape (n, 4), have unit length."""
    with np.errstate(over="ignore"):
        lengths = np.sqrt(np.einsum("ij,ij->i", rotations, rotations))
    wrong = np.abs(lengths - 1.0) > UNIT_TOLERANCE
    if wrong.any():
        first = int(wrong.argmax())
        length = lengths[first]
        raise InputError(
            f"rotation of {names[first]} is not a unit quaternion (length {length:.3g})"
        )


def flat(*parts: Any) -> Array:
    """Return the concatenated numbers of vectors (x, y, z) and quaternions (x, y, z, w)."""
    return np.array([getattr(part, axis) for part in parts for axis in FIELDS[type(part)]])


def push(message: geometry.WrenchStamped, tool_frame: str) -> tuple[int, str, Array]:
    """Return stamp [ns], axes ("world" or "tool") and wrench at the tool, shape (6,) [N, N m].

    Raises:
        InputError: The frame is neither, a number is not finite, or the stamp is not a time.
    """
    check_frame(message.header.frame_id, WORLD, tool_frame)
    axes = "tool" if message.header.frame_id == tool_frame else WORLD
    values = flat(message.wrench.force, message.wrench.torque)
    check_finite(values, WRENCH.__getitem__)
    return stamp_ns(message.header.stamp), axes, values


def external_wrench(message: geometry.WrenchStamped) -> tuple[int, Array]:
    """Return stamp [ns] and wrench in world axes, shape (6,) [N, N m]; errors as in `push`."""
    check_frame(message.header.frame_id, WORLD)
    stamp, _, values = push(message, WORLD)
    return stamp, values


def to_wrench_stamped(time_ns: int, values: Array, frame: str = WORLD) -> geometry.WrenchStamped:
    """Return the message of a wrench in the axes of a frame, shape (6,) [N, N m]."""
    message = geometry.WrenchStamped()
    message.header.stamp, message.header.frame_id = to_stamp(time_ns), frame
    force, torque = message.wrench.force, message.wrench.torque
    force.x, force.y, force.z, torque.x, torque.y, torque.z = values.tolist()
    return message


class SubtaskCodec:
    """Encoder and decoder of the messages of one subtask.

    Values and velocities are concatenated over its elements. Unused message fields must be finite,
    and rotations of unit length.

    Args:
        name: Name of the subtask.
        elements: Names of its elements, as in `joint_names`.
        axes: Axes of each element, a subset of x, y, z.
        rotates: True where each element has a rotation after its axes.
    """

    def __init__(
        self, name: str, elements: Sequence[str], axes: Sequence[str], rotates: bool = False
    ) -> None:
        self.name, self.elements, self.axes = name, tuple(elements), tuple(axes)
        count = len(self.elements)
        self.layout = Layout([len(self.axes)] * count, [rotates] * count)
        places = [AXES.index(axis) for axis in axes]
        self._in_pose = places + ([3, 4, 5, 6] if rotates else [])
        self._in_twist = places + ([3, 4, 5] if rotates else [])
        pose = np.array([7 * e + place for e in range(count) for place in self._in_pose])
        twist = np.array([6 * e + place for e in range(count) for place in self._in_twist])
        # Indices of value, velocity and acceleration among all numbers of a message.
        self._places = [pose, 7 * count + twist, 13 * count + twist]
        self._marker = CdrTemplate(self._motion(0))
        self._templates = [
            CdrTemplate(self._motion(given), np.concatenate(self._places[:given]).tolist())
            for given in (1, 2, 3)
        ]
        self._wrench = CdrTemplate(to_wrench_stamped(0, np.zeros(6)), self._in_twist)

    def encode(self, time_ns: int, *motion: Array) -> bytes:
        """Return a serialized MultiDOFJointTrajectory: reference, state or desired motion.

        `motion` is a value (size,), optionally with velocity and acceleration (dim,).
        """
        return self._templates[len(motion) - 1].encode(np.concatenate(motion), time_ns)

    def encode_marker(self, time_ns: int) -> bytes:
        """Return a serialized MultiDOFJointTrajectory without points; see `Marker`."""
        return self._marker.encode(np.zeros(0), time_ns)

    def encode_wrench(self, time_ns: int, force: Array) -> bytes:
        """Return a serialized WrenchStamped of a force (dim,); for subtasks with one element."""
        return self._wrench.encode(force, time_ns)

    def decode(self, data: bytes) -> ParsedReference | Marker:
        """Return the reference or marker of serialized bytes; errors as in `reference`."""
        for template in reversed(self._templates):
            found = template.decode(data)
            if found is not None:
                return self._parsed(*found)
        return self.reference(cdr.deserialize(data, MultiDOFJointTrajectory))

    def reference(self, message: MultiDOFJointTrajectory) -> ParsedReference | Marker:
        """Return the reference in the only point, with elements in any order, or the marker.

        Raises:
            InputError: The frame is not the world, an element is unknown, missing or given twice,
                there are several points, an array has a wrong size, accelerations are given
                without velocities, `time_from_start` is not zero, a number is not finite, a
                rotation is not of unit length, or the stamp is not a time.
        """
        stamp = stamp_ns(message.header.stamp)
        check_frame(message.header.frame_id, WORLD)
        if not message.points:
            return Marker(stamp)
        if len(message.points) > 1:
            raise InputError(f"{len(message.points)} points, allowed: 1")
        order = cdr.order_by_name(message.joint_names, self.elements, f"element of {self.name}")
        point = message.points[0]
        self._check_point(point)
        transforms = [point.transforms[place] for place in order]
        parts = [part for item in transforms for part in (item.translation, item.rotation)]
        for twists in (point.velocities, point.accelerations):
            items = [twists[place] for place in order if twists]
            parts += [part for item in items for part in (item.linear, item.angular)]
        return self._parsed(stamp, flat(*parts))

    def target(self, message: geometry.PoseStamped) -> tuple[int, Array]:
        """Return stamp [ns] and value (size,) of a set-point; errors as in `reference`."""
        values = flat(message.pose.position, message.pose.orientation)
        self._check_single(message, values, POSE)
        check_rotations(values[None, 3:], self.elements)
        return stamp_ns(message.header.stamp), self.layout.checked(values[self._in_pose])

    def rate(self, message: geometry.TwistStamped) -> tuple[int, Array]:
        """Return stamp [ns] and velocity (dim,) of a rate; errors as in `reference`."""
        values = flat(message.twist.linear, message.twist.angular)
        self._check_single(message, values, TWIST)
        return stamp_ns(message.header.stamp), values[self._in_twist]

    def force(self, message: geometry.WrenchStamped) -> tuple[int, Array]:
        """Return stamp [ns] and force (dim,) of a source; errors as in `reference`."""
        values = flat(message.wrench.force, message.wrench.torque)
        self._check_single(message, values, WRENCH)
        return stamp_ns(message.header.stamp), values[self._in_twist]

    def _check_single(self, message: Any, values: Array, labels: Sequence[str]) -> None:
        if len(self.elements) > 1:
            kind, count = type(message).__name__, len(self.elements)
            raise InputError(f"{kind} has one element, {self.name} has {count}: use `reference`")
        check_frame(message.header.frame_id, WORLD)
        check_finite(values, labels.__getitem__)

    def _check_point(self, point: MultiDOFJointTrajectoryPoint) -> None:
        count = len(self.elements)
        for name in ("transforms", "velocities", "accelerations"):
            size = len(getattr(point, name))
            if size != count and (size or name == "transforms"):
                raise InputError(f"{size} {name} for {count} elements")
        if point.accelerations and not point.velocities:
            raise InputError("accelerations without velocities")
        if point.time_from_start.sec or point.time_from_start.nanosec:
            raise InputError("time_from_start is not zero: the time is header.stamp")

    def _parsed(self, stamp: int, values: Array) -> ParsedReference:
        count = len(self.elements)
        check_finite(values, self._label)
        check_rotations(values[: 7 * count].reshape(count, 7)[:, 3:], self.elements)
        position = self.layout.checked(values[self._places[0]])
        rates = [values[at] if at[-1] < len(values) else None for at in self._places[1:]]
        return ParsedReference(stamp, position, *rates)

    def _label(self, place: int) -> str:
        count = len(self.elements)
        if place < 7 * count:
            return f"{POSE[place % 7]} of {self.elements[place // 7]}"
        order, twist = divmod(place - 7 * count, 6 * count)
        part = f"{('velocity', 'acceleration')[order]} {TWIST[twist % 6]}"
        return f"{part} of {self.elements[twist // 6]}"

    def _motion(self, given: int) -> MultiDOFJointTrajectory:
        message = MultiDOFJointTrajectory()
        message.header.frame_id = WORLD
        if given:
            message.joint_names = list(self.elements)
            point = MultiDOFJointTrajectoryPoint()
            point.transforms = [geometry.Transform() for _ in self.elements]
            point.velocities = [geometry.Twist() for _ in self.elements if given > 1]
            point.accelerations = [geometry.Twist() for _ in self.elements if given > 2]
            message.points = [point]
        return message


class EnergyCodec:
    """Encoder of std_msgs/Float64MultiArray with one labelled dimension per value."""

    def __init__(self, labels: Sequence[str]) -> None:
        message = Float64MultiArray(data=[0.0] * len(labels))
        message.layout.dim = [MultiArrayDimension(label=name, size=1, stride=1) for name in labels]
        self._template = CdrTemplate(message)

    def encode(self, values: Array) -> bytes:
        """Return the serialized message with one value per label."""
        return self._template.encode(values)


class Level(IntEnum):
    """Levels of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


def to_status(
    name: str, level: Level, text: str, values: Mapping[str, object]
) -> DiagnosticStatus:
    """Return a diagnostic status with values as strings, floats with six digits."""
    strings = {k: f"{v:.6g}" if isinstance(v, float) else str(v) for k, v in values.items()}
    pairs = [KeyValue(key=key, value=value) for key, value in strings.items()]
    return DiagnosticStatus(level=bytes([level]), name=name, message=text, values=pairs)


def to_diagnostics(time_ns: int, statuses: Iterable[DiagnosticStatus]) -> DiagnosticArray:
    """Return the message for `/diagnostics` at a time [ns]."""
    message = DiagnosticArray(status=list(statuses))
    message.header.stamp = to_stamp(time_ns)
    return message
