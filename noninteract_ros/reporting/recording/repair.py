# SPDX-License-Identifier: Apache-2.0
"""Repair of truncated or damaged recordings: keep all complete messages, rebuild the index."""

import os
from dataclasses import dataclass
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import IO

from mcap.opcode import Opcode
from mcap.records import Channel, Header, Metadata, Schema
from mcap.writer import CompressionType, Writer

from noninteract_ros.errors import RecordingError
from noninteract_ros.reporting.recording import records
from noninteract_ros.reporting.recording.run import FILE_NAME
from noninteract_ros.reporting.recording.writer import CHUNK_SIZE, LIBRARY, PROFILE


@dataclass(frozen=True, slots=True)
class RepairReport:
    """Result of a repair.

    Attributes:
        path: The repaired file.
        messages: Number of messages kept.
        lost_bytes: Stored size of the skipped content [bytes]; its messages are lost.
        reasons: Damage found, one line each; empty for an intact file.
    """

    path: Path
    messages: int
    lost_bytes: int
    reasons: tuple[str, ...]

    @property
    def intact(self) -> bool:
        """True if the file was intact."""
        return not self.reasons

    def __str__(self) -> str:
        if self.intact:
            return f"{self.path}: nothing to repair, {self.messages} messages"
        more = f"; {len(self.reasons) - 3} more" if len(self.reasons) > 3 else ""
        return (
            f"{self.path}: kept {self.messages} messages, skipped {self.lost_bytes} bytes "
            f"({'; '.join(self.reasons[:3])}{more})"
        )


def repair(path: str | Path, out: str | Path | None = None) -> RepairReport:
    """Write a complete file from a truncated or damaged one.

    The result replaces the target atomically; the original stays unchanged until then.

    Args:
        path: The file, or the folder with its `run.mcap`.
        out: File to write; None replaces the original.

    Raises:
        RecordingError: The file is missing, empty or not MCAP, or the result cannot be written.
    """
    path = Path(path)
    source = path / FILE_NAME if path.is_dir() else path
    target = Path(out) if out is not None else source
    try:
        with NamedTemporaryFile(dir=target.parent, suffix=".mcap", delete=False) as stream:
            temporary = Path(stream.name)
            try:
                copy = _Copy(stream)
                copy.copy_file(source)
                stream.close()
                if copy.reasons or target != source:
                    # Temporary files are private; restore the permissions of the original.
                    temporary.chmod(source.stat().st_mode & 0o777)
                    os.replace(temporary, target)
            finally:
                temporary.unlink(missing_ok=True)
    except OSError as error:
        raise RecordingError(f"{target}: cannot be written: {error.strerror or error}") from error
    return RepairReport(target, copy.messages, copy.lost_bytes, tuple(copy.reasons))


class _Copy:
    """Copy of the undamaged records of a file."""

    def __init__(self, stream: IO[bytes]) -> None:
        self.messages = 0
        self.lost_bytes = 0
        self.reasons: list[str] = []
        self._writer = Writer(stream, chunk_size=CHUNK_SIZE, compression=CompressionType.ZSTD)
        self._started = False
        self._schemas: dict[int, int] = {0: 0}  # 0 stands for no schema
        self._channels: dict[int, int] = {}

    def copy_file(self, path: Path) -> None:
        """Copy a file and finish the result."""
        try:
            for opcode, body in records.read_records(path):
                self._guarded(opcode, body)
        except records.EarlyEndError as error:
            self.lost_bytes += path.stat().st_size - error.offset
            self.reasons.append(f"{error.found} at byte {error.offset}")
        self._start(PROFILE, LIBRARY)
        self._writer.finish()

    def _guarded(self, opcode: int, body: bytes) -> None:
        try:
            for inner, content in records.unpacked(opcode, body):
                self._add(inner, content)
        except KeyError as error:
            self._skip(body, f"no channel or schema {error}")
        except (records.DamagedError, *records.DAMAGE) as error:
            self._skip(body, str(error))

    def _skip(self, body: bytes, reason: str) -> None:
        self.lost_bytes += len(body)
        self.reasons.append(reason)

    def _start(self, profile: str, library: str) -> None:
        if not self._started:
            self._writer.start(profile, library)
            self._started = True

    def _add(self, opcode: int, body: bytes) -> None:
        if opcode == Opcode.HEADER:
            header = Header.read(records.open_record(body))
            self._start(header.profile, header.library)
            return
        self._start(PROFILE, LIBRARY)
        if opcode == Opcode.MESSAGE:
            stored = records.stored_message(body)
            channel = self._channels[stored.channel]
            self._writer.add_message(
                channel, stored.log_time, stored.data, stored.publish_time, stored.sequence
            )
            self.messages += 1
        else:
            self._add_rare(opcode, body)

    def _add_rare(self, opcode: int, body: bytes) -> None:
        """Add a record that is not a message; the index is rebuilt by the writer."""
        content = records.open_record(body)
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(content)
            if schema.id not in self._schemas:
                new = self._writer.register_schema(schema.name, schema.encoding, schema.data)
                self._schemas[schema.id] = new
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(content)
            if channel.id not in self._channels:
                self._channels[channel.id] = self._writer.register_channel(
                    channel.topic,
                    channel.message_encoding,
                    self._schemas[channel.schema_id],
                    channel.metadata,
                )
        elif opcode == Opcode.ATTACHMENT:
            item = records.read_attachment(body)
            self._writer.add_attachment(
                item.create_time, item.log_time, item.name, item.media_type, item.data
            )
        elif opcode == Opcode.METADATA:
            metadata = Metadata.read(content)
            self._writer.add_metadata(metadata.name, metadata.metadata)
