# SPDX-License-Identifier: Apache-2.0
"""Messages of fixed shape, read and written in place in their serialized (CDR) form.

Names, sizes and frames of a run do not change, so neither do the bytes between its numbers: numpy
fetches the numbers at once, which for a message of 29 elements is about a hundred times cheaper
than message objects. Publishers take these bytes; subscriptions with `raw=True` deliver them.
"""

import struct
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from noninteract_ros.arrays import Array
from noninteract_ros.errors import InputError, one_of

Message = TypeVar("Message")
SECOND = 10**9
LARGEST = 1e9  # in any unit
QUANTITIES = ("position", "velocity", "effort")
ENCAPSULATION = b"\x00\x01\x00\x00"  # plain CDR, little-endian, no options
STAMP = struct.Struct("<iI")
FORMATS = {"int32": "<i", "uint32": "<I", "double": "<d"}


def join_stamp(sec: int, nanosec: int) -> int:
    """Stamp in nanoseconds from the two numbers of a message.

    Raises:
        InputError: The stamp is negative, or its nanoseconds make more than a second.
    """
    if sec < 0 or not 0 <= nanosec < SECOND:
        raise InputError(f"stamp {sec} s {nanosec} ns is not a time")
    return sec * SECOND + nanosec


def deserialize(data: bytes, message_type: type[Message]) -> Message:
    """The message object of serialized bytes.

    Raises:
        InputError: The bytes are no such message.
    """
    try:
        message: Message = deserialize_message(bytes(data), message_type)
    except RuntimeError as error:
        raise InputError(f"the bytes are not a {message_type.__name__}") from error
    return message


def check_finite(values: Array, label: Callable[[int], str]) -> None:
    """Refuses NaN, infinity, and numbers that no robot means but that would overflow torques.

    Args:
        values: Numbers (n,).
        label: Says in words what the i-th number is.

    Raises:
        InputError: A number is not finite or beyond `LARGEST`; the text has its label.
    """
    sane = np.abs(values) <= LARGEST
    if not sane.all():
        first = int(sane.argmin())
        raise InputError(f"{label(first)} is {values[first]}")


def order_by_name(found: Sequence[str], names: Sequence[str], what: str) -> list[int]:
    """Where each of `names` stands in `found`, which must hold the same names in any order.

    Raises:
        InputError: A name is unknown, missing or given twice; the text says which `what` it is.
    """
    if tuple(found) == tuple(names):
        return list(range(len(names)))
    places = {name: place for place, name in enumerate(found)}
    known = set(names)
    for name in places:
        if name not in known:
            raise InputError(
                f"{what} {name[:80]!r} is unknown, allowed: {one_of(names, name[:80])}"
            )
    for name in names:
        if name not in places:
            raise InputError(f"{what} {name!r} is missing")
    if len(found) != len(places):
        twice = next(name for name in names if list(found).count(name) > 1)
        raise InputError(f"{what} {twice!r} is given twice")
    return [places[name] for name in names]


class CdrTemplate:
    """The bytes of one message whose shape and texts stay the same; only stamp and numbers change.

    Its numbers are all float64 fields, in the order of the message definition. An instance writes
    into a buffer of its own: it serves one thread.

    Args:
        message: Any message. The stamp changes only where it begins with a header.
        written: Which of the numbers `encode` sets; all, if None. The others stay as they are.
    """

    def __init__(self, message: Any, written: Sequence[int] | None = None) -> None:
        layout = _Layout()
        layout.add_message(message)
        self._stamped = hasattr(message, "header")
        if self._stamped:
            layout.constant[: STAMP.size] = bytes(STAMP.size)
        self._end = 4 + len(layout.data)
        self._room = -(-len(layout.data) // 8) * 8
        # Numbers are aligned to 8 bytes from the end of the encapsulation; four bytes before it
        # put them on aligned addresses of this buffer, which numpy reads three times faster.
        self._buffer = bytearray(bytes(4) + ENCAPSULATION + layout.data.ljust(self._room, b"\0"))
        self._payload = memoryview(self._buffer)[4 : 4 + self._end]
        self._floats = np.frombuffer(self._buffer, "<f8", offset=8)
        self._mask = np.frombuffer(bytes(layout.constant.ljust(self._room, b"\0")), "<u8")
        self._expected = (self._floats.view("<u8") & self._mask).tobytes()
        self._places = np.array(layout.floats, dtype=np.intp)
        self._written = self._places if written is None else self._places[list(written)]

    def encode(self, values: Array, stamp_ns: int | None = None) -> bytes:
        """The bytes of the message with these numbers.

        Args:
            values: The numbers that are written (len(written),).
            stamp_ns: Stamp of the header [ns]; kept as it is, if None.

        Raises:
            ValueError: There are more or fewer numbers than places.
        """
        if values.shape != self._written.shape:
            raise ValueError(f"{values.shape} numbers for {self._written.shape} places")
        if stamp_ns is not None:
            STAMP.pack_into(self._buffer, 8, *divmod(stamp_ns, SECOND))
        self._floats[self._written] = values
        return bytes(self._payload)

    def decode(self, data: bytes) -> tuple[int, Array] | None:
        """Stamp [ns] (0 without a header) and all numbers of a message of this very shape.

        None where any other byte differs: that message has to be deserialized.

        Raises:
            InputError: The stamp is not a time.
        """
        if len(data) < self._end or data[:2] != ENCAPSULATION[:2]:
            return None
        words = np.frombuffer(data[4 : 4 + self._room].ljust(self._room, b"\0"), "<u8")
        if (words & self._mask).tobytes() != self._expected:
            return None
        stamp = join_stamp(*STAMP.unpack_from(data, 4)) if self._stamped else 0
        return stamp, words.view("<f8")[self._places]


class _Layout:
    """Serializes a message by its definition, and notes where the float64 fields and the gaps are.

    The gaps matter: the middleware leaves whatever was in memory there.

    Attributes:
        data: Serialized bytes, without encapsulation.
        constant: 0xFF for each byte of `data` that belongs to a text, a size or a whole number.
        floats: Where the float64 fields begin, in units of 8 bytes.
    """

    def __init__(self) -> None:
        self.data, self.constant = bytearray(), bytearray()
        self.floats: list[int] = []

    def add_message(self, message: Any) -> None:
        """Appends all fields of a message."""
        for name, kind in message.get_fields_and_field_types().items():
            self._add(getattr(message, name), kind)

    def _add(self, value: Any, kind: str) -> None:
        if kind in FORMATS:
            self._add_number(kind, value)
        elif kind == "string":
            text = value.encode() + b"\0"
            self._add_number("uint32", len(text))
            self.data += text
            self.constant += b"\xff" * len(text)
        elif kind.startswith("sequence<"):
            self._add_number("uint32", len(value))
            for item in value:
                self._add(item, kind[len("sequence<") : -1])
        else:
            self.add_message(value)

    def _add_number(self, kind: str, value: float) -> None:
        number = struct.pack(FORMATS[kind], value)
        gap = bytes(-len(self.data) % len(number))
        if kind == "double":
            self.floats.append((len(self.data) + len(gap)) // 8)
        self.data += gap + number
        self.constant += gap + (b"\0" if kind == "double" else b"\xff") * len(number)


class JointArrays(NamedTuple):
    """A sensor_msgs/JointState in the joint order of its codec.

    Attributes:
        stamp_ns: Stamp [ns].
        position: (n,) [m or rad], None where the message has none.
        velocity: (n,) [m/s or rad/s], None where the message has none.
        effort: (n,) [N or N m], None where the message has none.
    """

    stamp_ns: int
    position: Array | None
    velocity: Array | None
    effort: Array | None


class JointStateCodec:
    """sensor_msgs/JointState of joints whose names are known, to bytes and back.

    Args:
        names: The n joints, in the order of the arrays.
        frame_id: What encoded messages carry in the header; ignored in received ones.
        required: Which of position, velocity and effort a received message must have.
    """

    def __init__(
        self, names: Sequence[str], frame_id: str = "", required: Sequence[str] = ()
    ) -> None:
        self.names = tuple(names)
        self._frame_id, self._required = frame_id, tuple(required)
        self._templates: dict[tuple[str, ...], CdrTemplate] = {}
        for given in (QUANTITIES, ("effort",)):  # what robots and controllers send
            self._templates[given] = self._template(given)

    def encode(
        self,
        stamp_ns: int,
        position: Array | None = None,
        velocity: Array | None = None,
        effort: Array | None = None,
    ) -> bytes:
        """Serialized message with those arrays (n,) that are given."""
        arrays = dict(zip(QUANTITIES, (position, velocity, effort), strict=True))
        given = tuple(name for name, array in arrays.items() if array is not None)
        if given not in self._templates:
            self._templates[given] = self._template(given)
        values = [array for array in arrays.values() if array is not None]
        joined = np.concatenate(values) if values else np.zeros(0)
        return self._templates[given].encode(joined, stamp_ns)

    def decode(self, data: bytes) -> JointArrays:
        """Arrays of a serialized message with these joints, in any order.

        Raises:
            InputError: The bytes are no JointState, a joint is unknown, missing or given twice, an
                array has a wrong size or lacks, a number is not finite, the stamp is not a time.
        """
        for given, template in self._templates.items():
            found = template.decode(data)
            if found is not None:
                return self._checked(found[0], given, found[1])
        return self.from_message(deserialize(data, JointState))

    def from_message(self, message: JointState) -> JointArrays:
        """As `decode`, for a message object."""
        stamp = join_stamp(message.header.stamp.sec, message.header.stamp.nanosec)
        order = order_by_name(message.name, self.names, "joint")
        given, arrays = [], [np.zeros(0)]
        for name in QUANTITIES:
            array = np.array(getattr(message, name), dtype=float)
            if array.size == len(self.names):
                given.append(name)
                arrays.append(array[order])
            elif array.size:
                raise InputError(f"{name} has {array.size} numbers for {len(self.names)} joints")
        return self._checked(stamp, tuple(given), np.concatenate(arrays))

    def _checked(self, stamp: int, given: tuple[str, ...], values: Array) -> JointArrays:
        count = len(self.names)
        for name in self._required:
            if name not in given and count:
                raise InputError(f"{name} is missing")
        check_finite(values, lambda i: f"{given[i // count]} of {self.names[i % count]}")
        rows = dict(zip(given, values.reshape(len(given), count), strict=True))
        return JointArrays(stamp, *(rows.get(name) for name in QUANTITIES))

    def _template(self, given: tuple[str, ...]) -> CdrTemplate:
        message = JointState(name=self.names)
        message.header.frame_id = self._frame_id
        for name in given:
            setattr(message, name, [0.0] * len(self.names))
        return CdrTemplate(message)
