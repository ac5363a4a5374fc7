# SPDX-License-Identifier: Apache-2.0
"""Sequential reader of the records of an MCAP file that detects truncated files.

The readers of the `mcap` package either rely on the summary at the end of the file, which a killed
recorder never wrote, or accept a short read as a complete record.
"""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Chunk
from mcap.stream_reader import get_chunk_data_stream

from noninteract_ros.errors import RecordingError

MAGIC = bytes([0x89]) + b"MCAP0\r\n"
_FRAME = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
DAMAGE = (
    ValueError,
    OverflowError,
    MemoryError,
    struct.error,
    zstandard.ZstdError,
    McapError,
)
"""Errors that the `mcap` package raises on damaged records."""


class EarlyEndError(RecordingError):
    """Truncated file, such as that of a killed recorder.

    Attributes:
        path: The file.
        offset: First byte after the last complete record.
        found: Content at that offset.
    """

    def __init__(self, path: Path, offset: int, found: str) -> None:
        self.path, self.offset, self.found = path, offset, found
        super().__init__(
            f"{path}: {found} at byte {offset}: the recorder did not finish the file; "
            f"try: noninteract repair {path}"
        )


class DamagedError(RecordingError):
    """Record whose content does not match its checksum or type."""


class StoredMessage(NamedTuple):
    """One recorded message; times in ns since 1970, data as sent (CDR)."""

    channel: int
    sequence: int
    log_time: int
    publish_time: int
    data: bytes


def read_records(path: Path) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of each top-level record of a file.

    Raises:
        RecordingError: The file cannot be read, is empty, or is not MCAP.
        EarlyEndError: The file ends before its closing magic.
    """
    try:
        with path.open("rb") as stream:
            yield from _read_stream(path, stream, path.stat().st_size)
    except FileNotFoundError as error:
        raise RecordingError(f"{path}: no such file") from error
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from error


def _read_stream(path: Path, stream: BinaryIO, size: int) -> Iterator[tuple[int, bytes]]:
    start = stream.read(len(MAGIC))
    if not start:
        raise RecordingError(f"{path}: is empty")
    if not MAGIC.startswith(start):
        raise RecordingError(f"{path}: is not an MCAP file")
    at = len(start)
    while True:
        frame = stream.read(_FRAME.size)
        if len(frame) < _FRAME.size:
            raise EarlyEndError(path, at, "the file ends")
        opcode, length = _FRAME.unpack(frame)
        if opcode == 0:
            raise EarlyEndError(path, at, "a gap (no record)")
        # Check before reading: a damaged length may exceed the available memory.
        if length > size - at - _FRAME.size:
            raise EarlyEndError(path, at, "an incomplete record")
        yield opcode, stream.read(length)
        at += _FRAME.size + length
        if opcode == Opcode.FOOTER:
            break
    if stream.read(len(MAGIC)) != MAGIC:
        raise EarlyEndError(path, at, "no closing mark")


def open_record(body: bytes) -> ReadDataStream:
    """Open a record's content for the record types of the `mcap` package."""
    return ReadDataStream(BytesIO(body))


def unpack_chunk(body: bytes) -> bytes:
    """Decompress a chunk record.

    Raises:
        DamagedError: The checksum or the compression is wrong.
    """
    try:
        stream, size = get_chunk_data_stream(Chunk.read(open_record(body)), validate_crc=True)
        return stream.read(size)
    except DAMAGE as error:
        raise DamagedError(f"a chunk of {len(body)} bytes is damaged: {error}") from error


def read_attachment(body: bytes) -> Attachment:
    """Read an attachment record.

    Raises:
        DamagedError: The checksum is wrong.
    """
    expected = int.from_bytes(body[-4:], "little")
    if expected and zlib.crc32(body[:-4]) != expected:
        raise DamagedError(f"an attachment of {len(body)} bytes is damaged")
    return Attachment.read(open_record(body))


def split_records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of the records inside a decompressed chunk."""
    at = 0
    while at < len(data):
        opcode, length = _FRAME.unpack_from(data, at)
        at += _FRAME.size
        yield opcode, data[at : at + length]
        at += length


def unpacked(opcode: int, body: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield the records inside a chunk, or the record itself if it is not a chunk."""
    if opcode == Opcode.CHUNK:
        yield from split_records(unpack_chunk(body))
    else:
        yield opcode, body


def stored_message(body: bytes) -> StoredMessage:
    """Read a message record."""
    channel, sequence, log_time, publish_time = _MESSAGE.unpack_from(body)
    return StoredMessage(channel, sequence, log_time, publish_time, body[_MESSAGE.size :])
