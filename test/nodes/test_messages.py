# SPDX-License-Identifier: Apache-2.0
"""Messages are converted to arrays exactly, or rejected with a reason."""

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, Transform, Twist, TwistStamped, WrenchStamped
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from noninteract_ros.errors import InputError
from noninteract_ros.nodes.messages import cdr, messages
from noninteract_ros.nodes.messages.messages import EnergyCodec, Level, Marker, SubtaskCodec

STAMP = 3_000_000_007
EDGES = ("robot_1-robot_2", "robot_2-robot_3")
PAIR = SubtaskCodec("relative", EDGES, ("x", "z"))
ONE = SubtaskCodec("cooperative", ["cooperative"], ("x", "y"))
NAN, INF = float("nan"), float("inf")


def motion(codec: SubtaskCodec = PAIR, orders: int = 3) -> list[np.ndarray]:
    """Return position, velocity, acceleration, all numbers different."""
    dim = len(codec.elements) * len(codec.axes)
    return [10.0 * order + np.arange(1.0, dim + 1.0) for order in range(orders)]


def trajectory(codec: SubtaskCodec = PAIR, orders: int = 3) -> MultiDOFJointTrajectory:
    data = codec.encode(STAMP, *motion(codec, orders))
    return deserialize_message(data, MultiDOFJointTrajectory)


def changed(message, path: str, value):
    """Return the message with `a.b[0].c` set, for a path `a.b.0.c`."""
    *parents, last = path.split(".")
    owner = message
    for name in parents:
        owner = owner[int(name)] if name.isdigit() else getattr(owner, name)
    setattr(owner, last, value)
    return message


def stamped(kind, path: str = "header.frame_id", value="world"):
    """Return a message of a type at STAMP with one field set."""
    message = kind()
    message.header.stamp = messages.to_stamp(STAMP)
    return changed(message, path, value)


def wrench_of(vector) -> WrenchStamped:
    return messages.to_wrench_stamped(STAMP, np.array(vector, dtype=float))


def assert_motion(found, expected: list[np.ndarray]) -> None:
    assert found.stamp_ns == STAMP
    rows = [found.position, found.velocity, found.acceleration]
    for row, array in zip(rows[: len(expected)], expected, strict=True):
        np.testing.assert_array_equal(row, array)
    assert rows[len(expected) :] == [None] * (3 - len(expected))


@pytest.mark.parametrize("ns", [0, 1, 999_999_999, 10**9, STAMP, (2**31 - 1) * 10**9])
def test_stamps_are_converted_exactly(ns):
    assert messages.stamp_ns(messages.to_stamp(ns)) == ns


@pytest.mark.parametrize(("sec", "nanosec"), [(-1, 0), (0, 10**9), (3, 2**32 - 1)])
def test_invalid_stamps_are_rejected(sec, nanosec):
    with pytest.raises(InputError, match=f"stamp {sec} s {nanosec} ns is not a time"):
        messages.stamp_ns(Time(sec=sec, nanosec=nanosec))


def test_numbers_are_placed_by_axis():
    """Axes that the subtask does not have are zero, and rotations are identities."""
    message = trajectory()
    assert (message.header.frame_id, messages.stamp_ns(message.header.stamp)) == ("world", STAMP)
    assert message.joint_names == list(EDGES)
    (point,) = message.points
    moves = [t.translation for t in point.transforms]
    assert [(v.x, v.y, v.z) for v in moves] == [(1, 0, 2), (3, 0, 4)]
    assert [(v.linear.x, v.linear.y, v.linear.z) for v in point.velocities] == [
        (11, 0, 12),
        (13, 0, 14),
    ]
    assert point.accelerations[1].linear.z == 24
    assert all((t.rotation.x, t.rotation.w) == (0, 1) for t in point.transforms)


@pytest.mark.parametrize("orders", [1, 2, 3])
@pytest.mark.parametrize("codec", [PAIR, ONE], ids=lambda codec: codec.name)
def test_encoded_references_are_decoded_exactly(codec, orders, monkeypatch):
    """Encoded references are read in place, without the middleware."""
    monkeypatch.setattr(cdr, "deserialize_message", None)
    expected = motion(codec, orders)
    assert_motion(codec.decode(codec.encode(STAMP, *expected)), expected)


@pytest.mark.parametrize("count", [1, 2, 5, 29])
@pytest.mark.parametrize("orders", [1, 2, 3])
def test_references_of_the_middleware_are_read_in_place(count, orders, monkeypatch):
    elements = [f"e{i}" + "x" * (i % 8) for i in range(count)]
    codec = SubtaskCodec("s", elements, ("z", "x"))
    message = trajectory(codec, orders)
    data = serialize_message(message)
    assert_motion(codec.reference(message), motion(codec, orders))
    monkeypatch.setattr(cdr, "deserialize_message", None)
    assert_motion(codec.decode(data), motion(codec, orders))


def test_elements_may_be_in_any_order():
    message = trajectory()
    message.joint_names = message.joint_names[::-1]
    for name in ("transforms", "velocities", "accelerations"):
        setattr(message.points[0], name, getattr(message.points[0], name)[::-1])
    assert_motion(PAIR.reference(message), motion())
    assert_motion(PAIR.decode(serialize_message(message)), motion())


def test_an_empty_frame_is_the_world():
    message = changed(trajectory(), "header.frame_id", "")
    assert_motion(PAIR.decode(serialize_message(message)), motion())


def test_a_trajectory_without_points_is_a_marker():
    data = PAIR.encode_marker(STAMP)
    assert PAIR.decode(data) == Marker(STAMP)
    assert PAIR.reference(deserialize_message(data, MultiDOFJointTrajectory)) == Marker(STAMP)


BAD_REFERENCES = [
    (
        "joint_names",
        [EDGES[0], "robot_1-robot_3"],
        "element of relative 'robot_1-robot_3' is unkn",
    ),
    ("joint_names", [EDGES[0], EDGES[0]], "element of relative 'robot_2-robot_3' is missing"),
    ("joint_names", [*EDGES, EDGES[0]], "element of relative 'robot_1-robot_2' is given twice"),
    ("joint_names", [], "element of relative 'robot_1-robot_2' is missing"),
    ("points", [MultiDOFJointTrajectoryPoint()] * 2, "2 points, allowed: 1"),
    ("points.0.transforms", [Transform()], "1 transforms for 2 elements"),
    ("points.0.transforms", [], "0 transforms for 2 elements"),
    ("points.0.velocities", [Twist()] * 3, "3 velocities for 2 elements"),
    ("points.0.accelerations", [Twist()], "1 accelerations for 2 elements"),
    ("points.0.velocities", [], "accelerations without velocities"),
    ("points.0.time_from_start.nanosec", 1, "time_from_start is not zero"),
    ("points.0.transforms.1.translation.z", NAN, "z of robot_2-robot_3 is nan"),
    ("points.0.transforms.0.translation.y", INF, "y of robot_1-robot_2 is inf"),
    ("points.0.transforms.0.rotation.w", NAN, "rotation w of robot_1-robot_2 is nan"),
    ("points.0.velocities.1.linear.x", -INF, "velocity x of robot_2-robot_3 is -inf"),
    ("points.0.velocities.0.angular.z", NAN, "velocity angular z of robot_1-robot_2 is nan"),
    ("points.0.accelerations.1.linear.y", NAN, "acceleration y of robot_2-robot_3 is nan"),
    ("points.0.transforms.1.rotation.w", 0.0, "rotation of robot_2-robot_3 is not a unit quat"),
    ("points.0.transforms.0.rotation.x", 0.1, "rotation of robot_1-robot_2 is not a unit quat"),
    ("points.0.transforms.0.rotation.x", 1e8, "rotation of robot_1-robot_2 is not a unit quat"),
    ("points.0.transforms.0.translation.x", 1e300, "x of robot_1-robot_2 is 1e+300"),
    ("header.frame_id", "map", "frame 'map' is unknown, allowed: world"),
    ("header.stamp.sec", -1, "stamp -1 s 7 ns is not a time"),
    ("header.stamp.nanosec", 10**9, "stamp 3 s 1000000000 ns is not a time"),
]


@pytest.mark.parametrize(("path", "value", "reason"), BAD_REFERENCES)
def test_invalid_references_are_rejected(path, value, reason):
    """The reason is the same in place and by the middleware."""
    message = changed(trajectory(), path, value)
    for read in (PAIR.reference, lambda m: PAIR.decode(serialize_message(m))):
        with pytest.raises(InputError) as rejected:
            read(message)
        assert str(rejected.value).startswith(reason)


@pytest.mark.parametrize("path", ["header.frame_id", "header.stamp.sec"])
def test_invalid_markers_are_rejected(path):
    message = deserialize_message(PAIR.encode_marker(STAMP), MultiDOFJointTrajectory)
    changed(message, path, "map" if path.endswith("id") else -1)
    with pytest.raises(InputError):
        PAIR.decode(serialize_message(message))


def test_bytes_of_another_message_are_rejected():
    data = PAIR.encode(STAMP, *motion())
    for broken in (b"", data[:100], b"\xff" * 300, data[:-1]):
        with pytest.raises(InputError, match="the bytes are not a MultiDOFJointTrajectory"):
            PAIR.decode(broken)


def test_rotations_of_nearly_unit_length_are_accepted():
    message = changed(trajectory(), "points.0.transforms.0.rotation.w", 1.0 + 9e-4)
    assert_motion(PAIR.decode(serialize_message(message)), motion())


INPUTS = [
    (ONE.target, PoseStamped, "pose.position", "pose.orientation"),
    (ONE.rate, TwistStamped, "twist.linear", "twist.angular"),
    (ONE.force, WrenchStamped, "wrench.force", "wrench.torque"),
]


@pytest.mark.parametrize(("read", "kind", "linear", "angular"), INPUTS)
def test_single_inputs_are_read_on_the_axes_of_the_subtask(read, kind, linear, angular):
    message = changed(stamped(kind, f"{linear}.x", 1.5), f"{linear}.y", -2.5)
    changed(message, f"{linear}.z", 99.0)
    stamp, vector = read(message)
    assert stamp == STAMP
    np.testing.assert_array_equal(vector, [1.5, -2.5])


@pytest.mark.parametrize(("read", "kind", "linear", "angular"), INPUTS)
def test_invalid_single_inputs_are_rejected(read, kind, linear, angular):
    for path, value, reason in (
        (f"{linear}.y", NAN, "y is nan"),
        (f"{linear}.z", INF, "z is inf"),
        (f"{angular}.x", -INF, "x is -inf"),
        ("header.frame_id", "base", "frame 'base' is unknown, allowed: world"),
        ("header.stamp.sec", -2, "is not a time"),
    ):
        with pytest.raises(InputError, match=reason):
            read(stamped(kind, path, value))


@pytest.mark.parametrize(("field", "value"), [("w", 0.0), ("w", 0.99), ("y", 0.1)])
def test_quaternions_without_unit_length_are_rejected(field, value):
    with pytest.raises(InputError, match="rotation of cooperative is not a unit quaternion"):
        ONE.target(stamped(PoseStamped, f"pose.orientation.{field}", value))


def test_subtasks_with_several_elements_accept_references_only():
    for read, kind in ((PAIR.target, PoseStamped), (PAIR.rate, TwistStamped)):
        with pytest.raises(InputError, match="relative has 2: use `reference`"):
            read(stamped(kind))
    with pytest.raises(InputError, match="WrenchStamped has one element"):
        PAIR.force(stamped(WrenchStamped))


def test_forces_are_converted_exactly():
    message = deserialize_message(ONE.encode_wrench(STAMP, np.array([3.0, -4.0])), WrenchStamped)
    assert message.header.frame_id == "world"
    stamp, force = ONE.force(message)
    assert stamp == STAMP
    np.testing.assert_array_equal(force, [3.0, -4.0])


@pytest.mark.parametrize(("frame", "axes"), [("world", "world"), ("", "world"), ("hand", "tool")])
def test_the_axes_of_a_push_are_those_of_its_frame(frame, axes):
    message = changed(wrench_of([1, 2, 3, 4, 5, 6]), "header.frame_id", frame)
    stamp, found, wrench = messages.push(message, "hand")
    assert (stamp, found, wrench.tolist()) == (STAMP, axes, [1, 2, 3, 4, 5, 6])


def test_invalid_pushes_are_rejected():
    """The reason has both allowed frames, or the name of the number."""
    with pytest.raises(InputError, match=r"frame 'map' is unknown, allowed: world \| hand"):
        messages.push(changed(wrench_of(np.zeros(6)), "header.frame_id", "map"), "hand")
    with pytest.raises(InputError, match="torque y is nan"):
        messages.push(wrench_of([0, 0, 0, 0, NAN, 0]), "hand")
    with pytest.raises(InputError, match="not a time"):
        messages.push(changed(wrench_of(np.zeros(6)), "header.stamp.nanosec", 10**9), "hand")


def test_external_wrenches_are_in_the_world_frame():
    stamp, wrench = messages.external_wrench(wrench_of([1, 2, 3, 4, 5, 6]))
    assert (stamp, wrench.tolist()) == (STAMP, [1, 2, 3, 4, 5, 6])
    with pytest.raises(InputError, match="force z is inf"):
        messages.external_wrench(wrench_of([0, 0, INF, 0, 0, 0]))
    with pytest.raises(InputError, match=r"'hand' is unknown, allowed: world$"):
        messages.external_wrench(changed(wrench_of(np.zeros(6)), "header.frame_id", "hand"))


def test_energies_have_labels():
    data = EnergyCodec(["storage", "its rate", "tank"]).encode(np.array([1.0, -2.0, 3.5]))
    message = deserialize_message(data, Float64MultiArray)
    assert [(d.label, d.size, d.stride) for d in message.layout.dim] == [
        ("storage", 1, 1),
        ("its rate", 1, 1),
        ("tank", 1, 1),
    ]
    assert message.data.tolist() == [1.0, -2.0, 3.5]


def test_diagnostics_carry_level_and_values():
    """The level is a byte, as the message definition requires."""
    status = messages.to_status(
        "controller", Level.WARN, "late", {"period": 0.00123456789, "n": 3}
    )
    array = messages.to_diagnostics(STAMP, [status])
    read = deserialize_message(serialize_message(array), type(array))
    assert messages.stamp_ns(read.header.stamp) == STAMP
    (found,) = read.status
    assert (found.level, found.name, found.message) == (b"\x01", "controller", "late")
    assert [(v.key, v.value) for v in found.values] == [("period", "0.00123457"), ("n", "3")]
    assert max(Level.OK, Level.ERROR) is Level.ERROR


@pytest.mark.parametrize("size", [120, 176, 300])
def test_references_that_are_cut_off_or_too_long_are_rejected(size: int) -> None:
    """Bytes of the wrong length are no reference, not even one without velocity."""
    codec = SubtaskCodec("cooperative", ["cooperative"], ["x", "y"])
    data = codec.encode(10**9, np.ones(2), np.ones(2), np.ones(2))
    assert size < len(data) - 8 or size > len(data) + 8
    with pytest.raises(InputError, match="bytes"):
        codec.decode(data[:size].ljust(size, b"\0"))
    assert codec.decode(data + bytes(4)) is not None
