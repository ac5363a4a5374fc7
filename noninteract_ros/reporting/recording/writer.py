# SPDX-License-Identifier: Apache-2.0
"""Crash-tolerant MCAP writer for runs."""

from pathlib import Path
from types import TracebackType
from typing import Self

from mcap.writer import CompressionType, Writer

from noninteract_ros.errors import RecordingError
from noninteract_ros.reporting.recording.definitions import definition

PROFILE = "ros2"
LIBRARY = "noninteract_ros"
SCENARIO = "scenario.yaml"
CHUNK_SIZE = 64 * 1024  # bytes; largest loss of a killed recorder


class RunWriter:
    """Writer of serialized messages and their definitions into an MCAP file.

    The scenario is stored at the start of the file. Each full chunk is passed to the operating
    system at once: after a crash, `repair` loses one chunk at most.

    Attributes:
        path: The file.
        messages: Number of messages added.
        size: Serialized size of these messages [bytes].
    """

    def __init__(
        self, path: str | Path, scenario_text: str | None, overwrite: bool = False
    ) -> None:
        """Create the file and its folder.

        Args:
            path: File to create.
            scenario_text: Scenario of the run (YAML), stored as attachment `scenario.yaml`.
            overwrite: True to replace an existing file.

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
            raise RecordingError(f"{self.path}: file exists")
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
        """Number of topics with at least one message."""
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
        """Add one message.

        Args:
            topic: Full name of the topic.
            type_name: E.g. `sensor_msgs/msg/JointState`.
            log_time_ns: Time of reception [ns since 1970].
            publish_time_ns: Time of publication [ns since 1970].
            cdr_bytes: Serialized message with its encapsulation header.
            sequence: Sequence number of the publisher, 0 if unknown.

        Raises:
            RecordingError: The type is not installed, or the file cannot be written.
        """
        channel = self._channels.get((topic, type_name))
        if channel is None:
            channel = self._register(topic, type_name)
        try:
            # MCAP stores 32 bits of the sequence number.
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
        """Pass all messages so far to the operating system, in a chunk of their own.

        Raises:
            RecordingError: The file cannot be written.
        """
        try:
            self._writer.flush()
        except OSError as error:
            raise self._abandon(error) from error

    def close(self) -> None:
        """Finish the file; further calls have no effect.

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
        """Close the file as it is; its content on disk can be repaired."""
        try:
            self._stream.close()
        except OSError:
            # Closing flushes again and fails for the same reason; `raw` closes without a flush.
            self._stream.raw.close()
        return self._failure(error)

    def _failure(self, error: OSError) -> RecordingError:
        return RecordingError(f"{self.path}: cannot be written: {error.strerror or error}")
