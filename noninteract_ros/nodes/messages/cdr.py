# SPDX-License-Identifier: Apache-2.0
"""Messages of fixed shape, read and written in their serialized (CDR) form.

Names, sizes and frames do not change during a run, and neither do the bytes between the numbers.
numpy then reads all numbers at once, which for a message with 29 elements is about a hundred times
cheaper than message objects. Publishers accept serialized bytes; subscriptions with `raw=True`
deliver them.
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
MAX_MAGNITUDE = 1e9  # in any unit
QUANTITIES = ("position", "velocity", "effort")
ENCAPSULATION = b"\x00\x01\x00\x00"  # plain CDR, little-endian, no options
PADDING = 16  # bytes after a message: middleware overestimates the size of empty sequences
STAMP = struct.Struct("<iI")
FORMATS = {"int32": "<i", "uint32": "<I", "float": "<f", "double": "<d", "boolean": "<?"}


def join_stamp(sec: int, nanosec: int) -> int:
    """Return a stamp in nanoseconds.

    Raises:
        InputError: The stamp is negative, or its nanoseconds exceed one second.
    """
    if sec < 0 or not 0 <= nanosec < SECOND:
        raise InputError(f"stamp {sec} s {nanosec} ns is not a time")
    return sec * SECOND + nanosec


def deserialize(data: bytes, message_type: type[Message]) -> Message:
    """Return the message object of serialized bytes.

    The middleware reads missing sequences of a truncated message as empty. Such a message, and one
    with many bytes after its end, is rejected by its length.

    Raises:
        InputError: The bytes are not a message of this type.
    """
    name = message_type.__name__
    layout = _Layout()
    try:
        message: Message = deserialize_message(bytes(data), message_type)
    except Exception as error:  # Also texts that are no UTF-8.
        raise InputError(f"the bytes are not a {name}") from error
    try:
        layout.add_message(message)
    except AttributeError:  # Fields that no message of the loop has.
        return message
    size = len(ENCAPSULATION) + len(layout.data)
    if not 0 <= len(data) - size <= PADDING:
        raise InputError(f"{len(data)} bytes of a {name} of {size} bytes")
    return message


def check_finite(values: Array, label: Callable[[int], str]) -> None:
    """Reject NaN, infinity, and finite numbers so large that torques would overflow.

    Args:
        values: Numbers, shape (n,).
        label: Returns the name of the i-th number.

    Raises:
        InputError: A number is not finite or exceeds `MAX_MAGNITUDE`; the text has its label.
    """
    valid = np.abs(values) <= MAX_MAGNITUDE
    if not valid.all():
        first = int(valid.argmin())
        raise InputError(f"{label(first)} is {values[first]}")


def order_by_name(found: Sequence[str], names: Sequence[str], what: str) -> list[int]:
    """Return the index in `found` of each of `names`, which must be the same set of names.

    Args:
        found: Received names.
        names: Expected names.
        what: Kind of the names, for error texts.

    Raises:
        InputError: A name is unknown, missing or given twice.
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
    """Serialized message of fixed shape and strings, in which only stamp and numbers change.

    The numbers are all float64 fields, in the order of the message definition. An instance writes
    into its own buffer, so it must be used by one thread only.

    Args:
        message: Message of any type. The stamp changes only if the message has a header.
        written: Indices of the numbers set by `encode`; None for all. The others keep their value.
    """

    def __init__(self, message: Any, written: Sequence[int] | None = None) -> None:
        layout = _Layout()
        layout.add_message(message)
        self._stamped = hasattr(message, "header")
        if self._stamped:
            layout.constant[: STAMP.size] = bytes(STAMP.size)
        self._end = 4 + len(layout.data)
        self._room = -(-len(layout.data) // 8) * 8
        # Numbers are aligned to 8 bytes from the end of the encapsulation. Four leading bytes put
        # them on aligned addresses of this buffer, which numpy reads three times faster.
        self._buffer = bytearray(bytes(4) + ENCAPSULATION + layout.data.ljust(self._room, b"\0"))
        self._payload = memoryview(self._buffer)[4 : 4 + self._end]
        self._floats = np.frombuffer(self._buffer, "<f8", offset=8)
        self._mask = np.frombuffer(bytes(layout.constant.ljust(self._room, b"\0")), "<u8")
        self._expected = (self._floats.view("<u8") & self._mask).tobytes()
        self._places = np.array(layout.floats, dtype=np.intp)
        self._written = self._places if written is None else self._places[list(written)]

    def encode(self, values: Array, stamp_ns: int | None = None) -> bytes:
        """Return the serialized message with these numbers.

        Args:
            values: Written numbers, shape (len(written),).
            stamp_ns: Stamp of the header [ns]; None to keep it.

        Raises:
            ValueError: The number of values is wrong.
        """
        if values.shape != self._written.shape:
            raise ValueError(f"{values.shape} numbers for {self._written.shape} places")
        if stamp_ns is not None:
            STAMP.pack_into(self._buffer, 8, *divmod(stamp_ns, SECOND))
        self._floats[self._written] = values
        return bytes(self._payload)

    def decode(self, data: bytes) -> tuple[int, Array] | None:
        """Return the stamp [ns] (0 without a header) and all numbers of a message of this shape.

        Return None if any other byte differs; the message must then be deserialized.

        Raises:
            InputError: The stamp is not a time.
        """
        if not 0 <= len(data) - self._end <= PADDING or data[:2] != ENCAPSULATION[:2]:
            return None
        words = np.frombuffer(data[4 : 4 + self._room].ljust(self._room, b"\0"), "<u8")
        if (words & self._mask).tobytes() != self._expected:
            return None
        stamp = join_stamp(*STAMP.unpack_from(data, 4)) if self._stamped else 0
        return stamp, words.view("<f8")[self._places]


class _Layout:
    """Serialized layout of a message: float64 fields, constant bytes and padding.

    The middleware does not clear padding, so it must be ignored in comparisons.

    Attributes:
        data: Serialized bytes, without encapsulation.
        constant: 0xFF for each byte of `data` in a string, a size or an integer, else 0.
        floats: Offsets of the float64 fields, in units of 8 bytes.
    """

    def __init__(self) -> None:
        self.data, self.constant = bytearray(), bytearray()
        self.floats: list[int] = []

    def add_message(self, message: Any) -> None:
        """Append all fields of a message."""
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
    """Arrays of a sensor_msgs/JointState in the joint order of its codec.

    Attributes:
        stamp_ns: Stamp [ns].
        position: Positions, shape (n,) [m or rad], or None.
        velocity: Velocities, shape (n,) [m/s or rad/s], or None.
        effort: Efforts, shape (n,) [N or N m], or None.
    """

    stamp_ns: int
    position: Array | None
    velocity: Array | None
    effort: Array | None


class JointStateCodec:
    """Encoder and decoder of sensor_msgs/JointState for known joints.

    Args:
        names: Names of the n joints, in the order of the arrays.
        frame_id: Frame in the header of encoded messages; ignored in received ones.
        required: Quantities that a received message must have: position, velocity, effort.
    """

    def __init__(
        self, names: Sequence[str], frame_id: str = "", required: Sequence[str] = ()
    ) -> None:
        self.names = tuple(names)
        self._frame_id, self._required = frame_id, tuple(required)
        self._templates: dict[tuple[str, ...], CdrTemplate] = {}
        for given in (QUANTITIES, ("effort",)):  # as robots and controllers publish
            self._templates[given] = self._template(given)

    def encode(
        self,
        stamp_ns: int,
        position: Array | None = None,
        velocity: Array | None = None,
        effort: Array | None = None,
    ) -> bytes:
        """Return the serialized message with the given arrays, shape (n,)."""
        arrays = dict(zip(QUANTITIES, (position, velocity, effort), strict=True))
        given = tuple(name for name, array in arrays.items() if array is not None)
        if given not in self._templates:
            self._templates[given] = self._template(given)
        values = [array for array in arrays.values() if array is not None]
        joined = np.concatenate(values) if values else np.zeros(0)
        return self._templates[given].encode(joined, stamp_ns)

    def decode(self, data: bytes) -> JointArrays:
        """Return the arrays of a serialized message with these joints in any order.

        Raises:
            InputError: The bytes are not a JointState, a joint is unknown, missing or given twice,
                an array has a wrong size or is missing, a number is not finite, or the stamp is
                not a time.
        """
        for given, template in self._templates.items():
            found = template.decode(data)
            if found is not None:
                return self._checked(found[0], given, found[1])
        return self.from_message(deserialize(data, JointState))

    def from_message(self, message: JointState) -> JointArrays:
        """Return the arrays of a message object; see `decode`."""
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
