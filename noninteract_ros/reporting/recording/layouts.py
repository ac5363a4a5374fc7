# SPDX-License-Identifier: Apache-2.0
"""Layouts of serialized messages: offsets of the numbers, and the bytes that fix them.

Messages of one topic usually differ in their numbers only. Such messages are decoded together:
one message is walked field by field. All others with identical counts and texts are read by numpy
at the same offsets. Padding bytes are not compared, since serializers leave them undefined.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.errors import InputError

_ORIGIN = 4  # bytes of encapsulation header; alignment is relative to its end
_LITTLE_ENDIAN = b"\x00\x01"


class Block(NamedTuple):
    """Consecutive float64 numbers: byte offset of the first, and their count."""

    offset: int
    length: int


@dataclass(frozen=True, slots=True)
class MessageLayout:
    """Layout of one serialized message.

    Attributes:
        fixed: Offsets of the bytes (counts, texts) that another message of the same layout
            shares, shape (m,).
        names: Joint names, element names or labels.
        blocks: Numeric fields by name.
        stamp: Offset of `header.stamp`; None if the type has no header.
    """

    fixed: NDArray[np.intp]
    names: tuple[str, ...]
    blocks: dict[str, Block]
    stamp: int | None


class CdrWalker:
    """Sequential reader of one serialized message, in the order of its fields."""

    def __init__(self, data: bytes) -> None:
        """Start at the first field.

        Args:
            data: CDR bytes with the encapsulation header.

        Raises:
            InputError: The message is not plain little-endian CDR.
        """
        if data[:2] != _LITTLE_ENDIAN:
            raise InputError(
                f"not little-endian CDR (it starts with {data[:2].hex() or 'nothing'})"
            )
        self._data = data
        self._at = _ORIGIN
        self._fixed = [np.arange(2)]

    def count(self) -> int:
        """Read a uint32 that is part of the layout."""
        start = self._align(4)
        self._take(4)
        self._keep(start)
        (value,) = struct.unpack_from("<I", self._data, start)
        return int(value)

    def text(self) -> str:
        """Read a string that is part of the layout."""
        length = self.count()
        start = self._take(length)
        self._keep(start)
        return self._data[start : start + length].rstrip(b"\0").decode()

    def skip(self, size: int, count: int = 1) -> int:
        """Skip `count` numbers of `size` bytes each; return the offset of the first."""
        start = self._align(size)
        self._take(size * count)
        return start

    def doubles(self, count: int) -> Block:
        """Skip `count` float64 numbers; an empty block has no padding."""
        return Block(self.skip(8, count) if count else self._at, count)

    def layout(
        self, names: tuple[str, ...], blocks: dict[str, Block], stamp: int | None = None
    ) -> MessageLayout:
        """Return the layout of the fields read so far."""
        return MessageLayout(np.concatenate(self._fixed), names, blocks, stamp)

    def _align(self, size: int) -> int:
        self._at += -(self._at - _ORIGIN) % size
        return self._at

    def _take(self, length: int) -> int:
        start, self._at = self._at, self._at + length
        if self._at > len(self._data):
            raise InputError(f"ends after {len(self._data)} bytes, before its last field")
        return start

    def _keep(self, start: int) -> None:
        self._fixed.append(np.arange(start, self._at))


Walker = Callable[[bytes], MessageLayout]


def joint_state(data: bytes) -> MessageLayout:
    """Lay out a sensor_msgs/msg/JointState."""
    walk = CdrWalker(data)
    stamp = _header(walk)
    names = _texts(walk)
    blocks = {key: walk.doubles(walk.count()) for key in ("position", "velocity", "effort")}
    return walk.layout(names, blocks, stamp)


def trajectory(data: bytes) -> MessageLayout:
    """Lay out the first point of a trajectory_msgs/msg/MultiDOFJointTrajectory."""
    walk = CdrWalker(data)
    stamp = _header(walk)
    names = _texts(walk)
    blocks = {}
    if walk.count():
        blocks["transforms"] = walk.doubles(7 * walk.count())
        blocks["velocities"] = walk.doubles(6 * walk.count())
        blocks["accelerations"] = walk.doubles(6 * walk.count())
    return walk.layout(names, blocks, stamp)


def wrench_stamped(data: bytes) -> MessageLayout:
    """Lay out a geometry_msgs/msg/WrenchStamped; its only name is the frame."""
    walk = CdrWalker(data)
    stamp = walk.skip(4, 2)
    frame = walk.text()
    return walk.layout((frame,), {"wrench": walk.doubles(6)}, stamp)


def float64_multi_array(data: bytes) -> MessageLayout:
    """Lay out a std_msgs/msg/Float64MultiArray; names are the labels of its dimensions."""
    walk = CdrWalker(data)
    labels = []
    for _ in range(walk.count()):
        labels.append(walk.text())
        walk.skip(4, 2)
    walk.skip(4)
    return walk.layout(tuple(labels), {"data": walk.doubles(walk.count())})


def _header(walk: CdrWalker) -> int:
    stamp = walk.skip(4, 2)
    walk.text()
    return stamp


def _texts(walk: CdrWalker) -> tuple[str, ...]:
    return tuple(walk.text() for _ in range(walk.count()))


class Group(NamedTuple):
    """Messages of one layout.

    Attributes:
        layout: Common layout.
        rows: Indices of the messages, ascending, shape (m,).
        data: Serialized messages, shape (m, length).
    """

    layout: MessageLayout
    rows: NDArray[np.intp]
    data: NDArray[np.uint8]

    def doubles(self, block: Block) -> Array:
        """Return the numbers of a block, shape (m, count)."""
        part = self.data[:, block.offset : block.offset + 8 * block.length]
        return np.ascontiguousarray(part).view("<f8")

    def stamps(self) -> Array:
        """Return `header.stamp` of each message [s], shape (m,)."""
        assert self.layout.stamp is not None
        part = self.data[:, self.layout.stamp : self.layout.stamp + 8]
        parts = np.ascontiguousarray(part).view([("sec", "<i4"), ("nanosec", "<u4")])[:, 0]
        return parts["sec"] + parts["nanosec"] * 1e-9


def group_by_layout(messages: list[bytes], walker: Walker) -> list[Group]:
    """Group messages by layout.

    Raises:
        InputError: A message does not match its type; the text names its index.
    """
    by_length: dict[int, list[int]] = {}
    for index, message in enumerate(messages):
        by_length.setdefault(len(message), []).append(index)
    groups = []
    for length, members in by_length.items():
        rows = np.array(members, dtype=np.intp)
        joined = b"".join(messages[index] for index in members)
        data = np.frombuffer(joined, dtype=np.uint8).reshape(len(rows), length)
        while len(rows):
            try:
                layout = walker(messages[rows[0]])
            except (InputError, UnicodeDecodeError) as error:
                raise InputError(f"message {rows[0]}: {error}") from error
            same = (data[:, layout.fixed] == data[0, layout.fixed]).all(axis=1)
            groups.append(Group(layout, rows[same], data[same]))
            rows, data = rows[~same], data[~same]
    return groups
