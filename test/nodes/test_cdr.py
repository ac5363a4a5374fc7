# SPDX-License-Identifier: Apache-2.0
"""Messages serialized in place agree with the serialization of the middleware."""

import random

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from noninteract_ros.errors import InputError
from noninteract_ros.nodes.messages import cdr
from noninteract_ros.nodes.messages.cdr import (
    QUANTITIES,
    JointStateCodec,
    join_stamp,
    order_by_name,
)

NAMES = ("robot_1/x", "robot_1/long_joint", "é/q")
STAMP = 12_345_678_901
SHAPES = (QUANTITIES, ("effort",), ("position",), ("position", "velocity"), ())


def names_of(count: int) -> list[str]:
    """Return names of every length modulo 8, for every alignment of the numbers."""
    return [f"r{i}/" + "q" * (i % 8) for i in range(count)]


def numbers(count: int, given: tuple[str, ...] = QUANTITIES) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(count)
    return {name: rng.standard_normal(count) for name in given}


def message(names=NAMES, sec: int = 12, nanosec: int = 345_678_901, **arrays) -> JointState:
    result = JointState(name=list(names), **{k: list(map(float, v)) for k, v in arrays.items()})
    result.header.stamp.sec, result.header.stamp.nanosec = sec, nanosec
    return result


@pytest.fixture
def in_place_only(monkeypatch):
    """Fail the test if a message is not read in place."""

    def fail(*_):
        pytest.fail("the bytes were deserialized")

    monkeypatch.setattr(cdr, "deserialize_message", fail)


@pytest.mark.parametrize("given", SHAPES, ids="+".join)
@pytest.mark.parametrize("count", range(41))
def test_the_middleware_reads_encoded_messages(count, given):
    names, arrays = names_of(count), numbers(count, given)
    codec = JointStateCodec(names, frame_id="fr" * (count % 3))
    read = deserialize_message(codec.encode(STAMP, **arrays), JointState)
    assert (read.header.stamp.sec, read.header.stamp.nanosec) == (12, 345_678_901)
    assert read.header.frame_id == "fr" * (count % 3)
    assert read.name == names
    for name in QUANTITIES:
        assert getattr(read, name).tolist() == arrays.get(name, np.zeros(0)).tolist()


@pytest.mark.parametrize("given", SHAPES[:2], ids="+".join)
@pytest.mark.parametrize("count", range(41))
def test_messages_of_the_middleware_are_read_in_place(count, given, in_place_only):
    names, arrays = names_of(count), numbers(count, given)
    found = JointStateCodec(names).decode(serialize_message(message(names, **arrays)))
    assert found.stamp_ns == STAMP
    for name in QUANTITIES:
        array = getattr(found, name)
        if name in arrays or count == 0:
            np.testing.assert_array_equal(array, arrays.get(name, np.zeros(0)))
        else:
            assert array is None


def test_padding_is_ignored(in_place_only):
    """The middleware does not clear padding between fields."""
    codec = JointStateCodec(["abc"])
    data = bytearray(codec.encode(STAMP, effort=np.array([2.5])))
    padding = 4 + 8 + 4 + 1  # after the empty frame, before the number of names
    assert data[padding : padding + 3] == bytes(3)
    data[padding : padding + 3] = b"xyz"
    assert codec.decode(bytes(data)).effort == [2.5]


def test_trailing_bytes_are_ignored(in_place_only):
    codec = JointStateCodec(NAMES)
    assert codec.decode(codec.encode(STAMP, effort=np.ones(3)) + b"tail").stamp_ns == STAMP


def test_other_layouts_are_read_by_the_middleware():
    """Big-endian bytes, another frame or fewer arrays are deserialized."""
    codec = JointStateCodec(NAMES)
    framed = message(velocity=[1, 2, 3])
    framed.header.frame_id = "base"
    found = codec.decode(serialize_message(framed))
    assert found.position is None
    assert found.effort is None
    np.testing.assert_array_equal(found.velocity, [1, 2, 3])
    big = bytes.fromhex("00000000 00000001 00000002 00000001 00000000 00000000 00000000 00000000")
    big += bytes.fromhex("00000000")
    assert JointStateCodec([]).decode(big).stamp_ns == 1_000_000_002


def test_decoded_arrays_are_copies():
    codec = JointStateCodec(NAMES)
    first = codec.decode(codec.encode(STAMP, **numbers(3)))
    kept = first.position.copy()
    first.velocity[:] = 0.0
    codec.encode(STAMP, **{name: np.full(3, 9.0) for name in QUANTITIES})
    np.testing.assert_array_equal(first.position, kept)


def test_joints_may_be_in_any_order():
    """Joints are matched by name."""
    codec, arrays = JointStateCodec(NAMES), numbers(3)
    order = [2, 0, 1]
    shuffled = {name: array[order] for name, array in arrays.items()}
    data = serialize_message(message([NAMES[i] for i in order], **shuffled))
    found = codec.decode(data)
    for name in QUANTITIES:
        np.testing.assert_array_equal(getattr(found, name), arrays[name])


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (
            message(("robot_1/x", "robot_9/x", "é/q")),
            "joint 'robot_9/x' is unknown, allowed: robot",
        ),
        (message((*NAMES, "robot_9/x")), "joint 'robot_9/x' is unknown"),
        (message(NAMES[:2]), "joint 'é/q' is missing"),
        (message((*NAMES, "robot_1/x")), "joint 'robot_1/x' is given twice"),
        (message(()), "joint 'robot_1/x' is missing"),
        (message(effort=[1, 2]), "effort has 2 numbers for 3 joints"),
        (message(position=[1, 2, 3, 4]), "position has 4 numbers for 3 joints"),
        (message(velocity=[1, 2, 3]), "effort is missing"),
        (message(effort=[1, np.nan, 3]), "effort of robot_1/long_joint is nan"),
        (message(position=[1, 2, -np.inf], effort=[1, 2, 3]), "position of é/q is -inf"),
        (message(NAMES[::-1], effort=[np.inf, 2, 3]), "effort of é/q is inf"),
        (message(sec=-1, effort=[1, 2, 3]), "stamp -1 s"),
        (message(nanosec=10**9, effort=[1, 2, 3]), "stamp 12 s 1000000000 ns is not a time"),
        (message(nanosec=10**9, position=[1, 2, 3], effort=[1, 2, 3]), "is not a time"),
    ],
)
def test_invalid_messages_are_rejected(bad, reason):
    """The reason is the same in place and by the middleware."""
    codec = JointStateCodec(NAMES, required=("effort",))
    for read in (codec.from_message, lambda m: codec.decode(serialize_message(m))):
        with pytest.raises(InputError) as rejected:
            read(bad)
        assert str(rejected.value).startswith(reason) or reason in str(rejected.value)


@pytest.mark.parametrize("data", [b"", b"\0\1\0\0", b"\xff" * 200, bytes(7)], ids=repr)
def test_bytes_of_another_message_are_rejected(data):
    with pytest.raises(InputError, match="the bytes are not a JointState"):
        JointStateCodec(NAMES).decode(data)


def test_truncated_messages_are_rejected():
    codec = JointStateCodec(NAMES)
    data = codec.encode(STAMP, **numbers(3))
    for length in range(len(data)):
        with pytest.raises(InputError):
            codec.decode(data[:length])


def mutated(data: bytes, rng: random.Random) -> bytes:
    """Return the bytes with a few of them changed, removed or added."""
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 5))):
        at = rng.randrange(len(changed) + 1)
        kind = rng.randrange(4)
        if kind == 0:
            changed[at : at + 1] = rng.randbytes(1)
        elif kind == 1:
            changed[at : at + 4] = bytes([rng.choice((0, 1, 127, 128, 255))] * 4)
        elif kind == 2:
            del changed[at : at + rng.randrange(9)]
        else:
            changed[at:at] = rng.randbytes(rng.randrange(9))
    return bytes(changed)


def test_corrupt_messages_raise_input_errors_only():
    """Corrupt bytes are rejected or give finite numbers of the right size."""
    codec, rng, rejections = JointStateCodec(NAMES), random.Random(1), 0
    valid = [codec.encode(STAMP, **numbers(3, given)) for given in SHAPES]
    valid.append(serialize_message(message(NAMES[::-1], **numbers(3))))
    for _ in range(6000):
        try:
            found = codec.decode(mutated(rng.choice(valid), rng))
        except InputError:
            rejections += 1
            continue
        assert found.stamp_ns >= 0
        for array in (found.position, found.velocity, found.effort):
            assert array is None or (array.shape == (3,) and np.isfinite(array).all())
    assert 1000 < rejections < 6000


def test_wrong_sizes_are_not_encoded():
    codec = JointStateCodec(NAMES)
    for size in (1, 2, 4):
        with pytest.raises(ValueError, match="numbers for"):
            codec.encode(STAMP, effort=np.zeros(size))


def test_stamps_are_converted_exactly():
    assert join_stamp(2**31 - 1, 999_999_999) == (2**31 - 1) * 10**9 + 999_999_999


def test_long_names_are_shortened_in_the_reason():
    with pytest.raises(InputError) as rejected:
        order_by_name(["x" * 10_000], ["a"], "joint")
    assert len(str(rejected.value)) < 200
