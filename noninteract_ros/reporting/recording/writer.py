# SPDX-License-Identifier: Apache-2.0
"""Writes a run to an MCAP file that survives the death of its writer."""

from pathlib import Path
from types import TracebackType
from typing import Self

from mcap.writer import CompressionType, Writer

from noninteract_ros.errors import RecordingError
from noninteract_ros.reporting.recording.definitions import definition

PROFILE = "ros2"
LIBRARY = "noninteract_ros"
SCENARIO = "scenario.yaml"
CHUNK_SIZE = 64 * 1024  # bytes; what a killed recorder can lose at most


class RunWriter:
    """Writes serialized messages, with their definitions, into `run.mcap`.

    The scenario stands at the start of the file, and each chunk goes to the operating system as
    soon as it is full: of a recorder that is killed, `repair` loses one chunk at most.

    Attributes:
        path: The file.
        messages: How many messages were added.
        size: Their serialized size [bytes].
    """

    def __init__(
        self, path: str | Path, scenario_text: str | None, overwrite: bool = False
    ) -> None:
        """Creates the file and, where needed, its folder.

        Args:
            path: File to create.
            scenario_text: The scenario (YAML) of the run, kept as attachment `scenario.yaml`.
            overwrite: Whether a file that exists is replaced.

        Raises:
            RecordingError: The file exists, or cannot be written.
        """
        self.path = Path(path)
        self.messages = 0
        self.size = 0
        self._channels: dict[tuple[str, str], int] = {}
        self._schemas: dict[str, int] = {}
        self._unflushed = 0
        if self.path.exists() and not overwrite:
            raise RecordingError(f"{self.path}: exists and is not overwritten")
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._stream = self.path.open("wb" if overwrite else "xb")
        except OSError as error:
            raise self._failure(error) from error
        self._writer = Writer(
            self._stream, chunk_size=CHUNK_SIZE, compression=CompressionType.ZSTD
        )
        try:
            self._writer.start(PROFILE, LIBRARY)
            if scenario_text is not None:
                data = scenario_text.encode()
                self._writer.add_attachment(0, 0, SCENARIO, "application/yaml", data)
            self._stream.flush()
        except OSError as error:
            raise self._abandon(error) from error

    @property
    def topics(self) -> int:
        """How many topics have at least one message."""
        return len({topic for topic, _ in self._channels})

    def add(
        self,
        topic: str,
        type_name: str,
        log_time_ns: int,
        publish_time_ns: int,
        cdr_bytes: bytes,
        sequence: int = 0,
    ) -> None:
        """Adds one message.

        Args:
            topic: Full name.
            type_name: E.g. `sensor_msgs/msg/JointState`.
            log_time_ns: When it was received, in ns since 1970.
            publish_time_ns: When it was sent, in ns since 1970.
            cdr_bytes: The serialized message, with its encapsulation header.
            sequence: The publisher's number of the message, 0 where unknown.

        Raises:
            RecordingError: The type has no definition here, or the file cannot be written.
        """
        channel = self._channels.get((topic, type_name))
        if channel is None:
            channel = self._register(topic, type_name)
        try:
            # MCAP has 32 bits for the number; a publisher may count further.
            self._writer.add_message(
                channel, log_time_ns, cdr_bytes, publish_time_ns, sequence & 0xFFFFFFFF
            )
            self._unflushed += len(cdr_bytes)
            if self._unflushed > CHUNK_SIZE:
                self._stream.flush()
                self._unflushed = 0
        except OSError as error:
            raise self._abandon(error) from error
        self.messages += 1
        self.size += len(cdr_bytes)

    def flush(self) -> None:
        """Hands all messages so far to the operating system, in a chunk of their own.

        Raises:
            RecordingError: The file cannot be written.
        """
        try:
            self._writer.flush()
        except OSError as error:
            raise self._abandon(error) from error

    def close(self) -> None:
        """Finishes the file; a second call does nothing.

        Raises:
            RecordingError: The file cannot be written.
        """
        if self._stream.closed:
            return
        try:
            self._writer.finish()
            self._stream.close()
        except OSError as error:
            raise self._abandon(error) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _register(self, topic: str, type_name: str) -> int:
        text = definition(type_name)
        try:
            if type_name not in self._schemas:
                schema = self._writer.register_schema(type_name, "ros2msg", text.encode())
                self._schemas[type_name] = schema
            channel = self._writer.register_channel(topic, "cdr", self._schemas[type_name])
        except OSError as error:
            raise self._abandon(error) from error
        self._channels[topic, type_name] = channel
        return channel

    def _abandon(self, error: OSError) -> RecordingError:
        """Gives the file up as it is: what reached the disk can be repaired."""
        try:
            self._stream.close()
        except OSError:
            # Closing flushes once more, and fails for the reason that is being reported; the
            # second call then closes without a flush.
            self._stream.raw.close()
        return self._failure(error)

    def _failure(self, error: OSError) -> RecordingError:
        return RecordingError(f"{self.path}: cannot be written: {error.strerror or error}")
