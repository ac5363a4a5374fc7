# SPDX-License-Identifier: Apache-2.0
"""Reader of recorded runs."""

import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Self, TypeVar

import numpy as np
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from mcap_ros2.decoder import DecoderFactory
from numpy.typing import NDArray

from noninteract_ros.errors import InputError, RecordingError, one_of
from noninteract_ros.reporting.recording import records, series
from noninteract_ros.reporting.recording.writer import SCENARIO

FILE_NAME = "run.mcap"
JOINT_STATE = "sensor_msgs/msg/JointState"
TRAJECTORY = "trajectory_msgs/msg/MultiDOFJointTrajectory"
WRENCH = "geometry_msgs/msg/WrenchStamped"
LABELLED = "std_msgs/msg/Float64MultiArray"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"

Series = TypeVar("Series")


class Topic:
    """Messages of one topic in the order of arrival.

    Attributes:
        name: Full name.
        schema: Message type and definition.
        data: Serialized messages, length n.
        log_times: Times of reception [ns since 1970], length n.
        publish_times: Times of publication [ns since 1970], length n.
    """

    def __init__(self, name: str, schema: Schema) -> None:
        self.name, self.schema = name, schema
        self.data: list[bytes] = []
        self.log_times: list[int] = []
        self.publish_times: list[int] = []


class Run:
    """A recorded run.

    Topics are given by full name (`/team/joint_states`) or by its last part (`joint_states`) if
    that is unique.

    Attributes:
        path: The file.
        scenario: Scenario of the run (YAML); None if the file has none.
        topics: Message type of each topic with messages.
    """

    def __init__(self, path: Path, scenario: str | None, topics: list[Topic]) -> None:
        self.path, self.scenario = path, scenario
        self._topics = {topic.name: topic for topic in topics}
        self.topics = {topic.name: topic.schema.name for topic in topics}

    @classmethod
    def open(cls, path: str | Path) -> Self:
        """Read a recording.

        Args:
            path: The file, or the folder with its `run.mcap`.

        Raises:
            RecordingError: The file is missing, empty, not MCAP, damaged or truncated.
        """
        path = Path(path)
        file = path / FILE_NAME if path.is_dir() else path
        if path.is_dir() and not file.exists():
            raise RecordingError(f"{path}: no {FILE_NAME} in this folder")
        loader = _Loader(file)
        for opcode, body in records.read_records(file):
            loader.add(opcode, body)
        return cls(
            file, loader.scenario, [topic for topic in loader.topics.values() if topic.data]
        )

    def joints(self, topic: str) -> series.JointSeries:
        """Return joint states or commands.

        Raises:
            RecordingError: The topic is missing, of another type, or holds a malformed message.
        """
        return self._decode(topic, JOINT_STATE, lambda found: series.joint_series(found.data))

    def trajectory(self, topic: str) -> series.TrajectorySeries:
        """Return states, desired values or references of a subtask.

        Raises:
            RecordingError: The topic is missing, of another type, or holds a malformed message.
        """
        return self._decode(topic, TRAJECTORY, lambda found: series.trajectory_series(found.data))

    def wrench(self, topic: str) -> series.WrenchSeries:
        """Return wrenches.

        Raises:
            RecordingError: The topic is missing, of another type, or holds a malformed message.
        """
        return self._decode(topic, WRENCH, lambda found: series.wrench_series(found.data))

    def labelled(self, topic: str) -> series.LabelledSeries:
        """Return labelled numbers, such as the energies of a subtask.

        Raises:
            RecordingError: The topic is missing, of another type, or holds a malformed message.
        """

        def read(found: Topic) -> series.LabelledSeries:
            sent = np.array(found.publish_times, dtype=np.float64) * 1e-9
            return series.labelled_series(found.data, sent)

        return self._decode(topic, LABELLED, read)

    def diagnostics(self, topic: str = "/diagnostics") -> list[dict[str, Any]]:
        """Return all statuses in the order of arrival: stamp [s], name, level, message, values.

        Raises:
            RecordingError: The topic is missing, of another type, or holds a malformed message.
        """
        self._of_type(topic, DIAGNOSTICS)
        return [
            {
                "stamp": array.header.stamp.sec + array.header.stamp.nanosec * 1e-9,
                "name": status.name,
                "level": status.level,
                "message": status.message,
                "hardware_id": status.hardware_id,
                "values": {item.key: item.value for item in status.values},
            }
            for array in self.messages(topic)
            for status in array.status
        ]

    def messages(self, topic: str) -> Iterator[Any]:
        """Decode the messages of a topic one by one, into objects with the fields of the type.

        Raises:
            RecordingError: The topic is missing or holds a malformed message.
        """
        found = self._find(topic)
        decode = DecoderFactory().decoder_for("cdr", found.schema)
        if decode is None:
            raise RecordingError(
                f"{self.path}: {found.name}: unknown encoding {found.schema.encoding!r}"
            )
        for index, data in enumerate(found.data):
            try:
                yield decode(data)
            except (McapError, ValueError, struct.error) as error:
                raise RecordingError(
                    f"{self.path}: {found.name}: message {index}: {error}"
                ) from error

    def log_times(self, topic: str) -> NDArray[np.int64]:
        """Return the times of reception of a topic [ns since 1970], shape (n,).

        Raises:
            RecordingError: The topic is missing.
        """
        return np.array(self._find(topic).log_times, dtype=np.int64)

    def publish_times(self, topic: str) -> NDArray[np.int64]:
        """Return the times of publication of a topic [ns since 1970], shape (n,).

        Raises:
            RecordingError: The topic is missing.
        """
        return np.array(self._find(topic).publish_times, dtype=np.int64)

    def _decode(self, name: str, type_name: str, read: Callable[[Topic], Series]) -> Series:
        found = self._of_type(name, type_name)
        try:
            return read(found)
        except InputError as error:
            raise RecordingError(f"{self.path}: {found.name}: {error}") from error

    def _of_type(self, name: str, type_name: str) -> Topic:
        found = self._find(name)
        if found.schema.name != type_name:
            raise RecordingError(
                f"{self.path}: {found.name} holds {found.schema.name}, not {type_name}"
            )
        return found

    def _find(self, name: str) -> Topic:
        if name in self._topics:
            return self._topics[name]
        fitting = [full for full in self._topics if full.endswith(f"/{name.lstrip('/')}")]
        # Topics of the team have precedence over those of its robots.
        highest = min((full.count("/") for full in fitting), default=0)
        fitting = [full for full in fitting if full.count("/") == highest]
        if len(fitting) == 1 and not name.startswith("/"):
            return self._topics[fitting[0]]
        problem = "matches several topics" if len(fitting) > 1 else "is not in the recording"
        raise RecordingError(
            f"{self.path}: topic {name} {problem}, allowed: "
            f"{one_of(fitting if len(fitting) > 1 else self._topics, name)}"
        )


class _Loader:
    """Messages of a file by topic."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.scenario: str | None = None
        self.topics: dict[tuple[str, str], Topic] = {}
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Topic] = {}

    def add(self, opcode: int, body: bytes) -> None:
        """Add one record.

        Raises:
            RecordingError: The record is damaged.
        """
        try:
            for inner, content in records.unpacked(opcode, body):
                self._add(inner, content)
        except (records.DamagedError, KeyError, *records.DAMAGE) as error:
            raise RecordingError(
                f"{self.path}: is damaged ({error}); try: noninteract repair {self.path}"
            ) from error

    def _add(self, opcode: int, body: bytes) -> None:
        if opcode == Opcode.MESSAGE:
            message = records.stored_message(body)
            topic = self._channels[message.channel]
            topic.data.append(message.data)
            topic.log_times.append(message.log_time)
            topic.publish_times.append(message.publish_time)
        elif opcode == Opcode.SCHEMA:
            schema = Schema.read(records.open_record(body))
            self._schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(records.open_record(body))
            schema = self._schemas[channel.schema_id]
            key = channel.topic, schema.name
            self._channels[channel.id] = self.topics.setdefault(key, Topic(channel.topic, schema))
        elif opcode == Opcode.ATTACHMENT:
            attachment = records.read_attachment(body)
            if attachment.name == SCENARIO:
                self.scenario = attachment.data.decode()
