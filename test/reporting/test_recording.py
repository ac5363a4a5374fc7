# SPDX-License-Identifier: Apache-2.0
"""Files of `RunWriter` are readable by other MCAP readers."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from noninteract_ros.errors import RecordingError
from noninteract_ros.reporting.recording.definitions import definition
from noninteract_ros.reporting.recording.repair import repair
from noninteract_ros.reporting.recording.run import Run
from noninteract_ros.reporting.recording.writer import CHUNK_SIZE, RunWriter

JOINT_STATE = "sensor_msgs/msg/JointState"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"

KILLED_WRITER = """
import os, signal, sys
from noninteract_ros.reporting.recording.writer import RunWriter

writer = RunWriter(sys.argv[1], "rate: 1000.0")
for number in range(20_000):
    writer.add("/a", "sensor_msgs/msg/JointState", number, number, os.urandom(50), number)
os.kill(os.getpid(), signal.SIGKILL)
"""

FULL_DISK_WRITER = """
import os, resource, sys
from noninteract_ros.reporting.recording.writer import RunWriter
from noninteract_ros.errors import RecordingError

resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
writer = RunWriter(sys.argv[1], "rate: 1000.0")
try:
    for number in range(20_000):
        writer.add("/a", "sensor_msgs/msg/JointState", number, number, os.urandom(50), number)
except RecordingError as error:
    writer.close()
    print(error)
"""


def joint_state(number: int) -> bytes:
    message = JointState(name=["a/x", "a/y"], position=[float(number), 2.0], effort=[1.0, -1.0])
    message.header.stamp.sec = number
    return serialize_message(message)


def test_other_readers_decode_every_message(tmp_path: Path) -> None:
    """The plain MCAP reader with the ROS 2 decoder reads values, times, numbers and scenario."""
    status = DiagnosticStatus(level=DiagnosticStatus.WARN, name="controller", message="late")
    status.values = [KeyValue(key="rate", value="999.5")]
    with RunWriter(tmp_path / "run.mcap", "rate: 1000.0") as writer:
        for number in range(5):
            writer.add(
                "/team/joint_states",
                JOINT_STATE,
                10 + number,
                number,
                joint_state(number),
                number + 1,
            )
        data = serialize_message(DiagnosticArray(status=[status]))
        writer.add("/diagnostics", DIAGNOSTICS, 20, 19, data)
        assert (writer.messages, writer.topics) == (6, 2)
    with (tmp_path / "run.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        (attachment,) = reader.iter_attachments()
        assert (attachment.name, attachment.data) == ("scenario.yaml", b"rate: 1000.0")
        *joints, (schema, _, _, diagnostics) = reader.iter_decoded_messages()
    assert [list(item[3].position) for item in joints] == [[float(n), 2.0] for n in range(5)]
    assert [(item[2].log_time, item[2].publish_time, item[2].sequence) for item in joints] == [
        (10 + n, n, n + 1) for n in range(5)
    ]
    assert schema.name == DIAGNOSTICS
    assert diagnostics.status[0].level == 1
    assert diagnostics.status[0].values[0].value == "999.5"


def test_a_killed_writer_loses_less_than_two_chunks(tmp_path: Path) -> None:
    """After kill -9 the scenario and all but the messages of the last chunk can be repaired."""
    path = tmp_path / "run.mcap"
    subprocess.run([sys.executable, "-c", KILLED_WRITER, str(path)], timeout=60, check=False)
    with pytest.raises(RecordingError, match="noninteract repair"):
        Run.open(path)
    report = repair(path)
    run = Run.open(path)
    assert run.scenario == "rate: 1000.0"
    assert list(run.log_times("/a")) == list(range(report.messages))
    stored = 50 + 31  # a message and its record
    assert (20_000 - report.messages) * stored < 2 * CHUNK_SIZE


def test_flush_saves_a_chunk_that_is_not_full(tmp_path: Path) -> None:
    """Messages before `flush` are in the file without `close`."""
    path = tmp_path / "run.mcap"
    with RunWriter(path, None) as writer:
        writer.add("/a", JOINT_STATE, 0, 0, joint_state(0))
        writer.flush()
        assert repair(path, tmp_path / "copy.mcap").messages == 1


def test_an_existing_file_is_kept_by_default(tmp_path: Path) -> None:
    """Overwriting a run must be requested."""
    path = tmp_path / "run.mcap"
    path.write_bytes(b"precious")
    with pytest.raises(RecordingError, match="exists"):
        RunWriter(path, None)
    assert path.read_bytes() == b"precious"
    RunWriter(path, None, overwrite=True).close()
    assert Run.open(path).topics == {}


def test_a_full_disk_is_reported_and_the_file_can_be_repaired(tmp_path: Path) -> None:
    """The writer raises one error that names the file."""
    path = tmp_path / "run.mcap"
    result = subprocess.run(
        [sys.executable, "-c", FULL_DISK_WRITER, str(path)],
        timeout=60,
        check=True,
        capture_output=True,
        text=True,
    )
    assert result.stdout.splitlines() == [f"{path}: cannot be written: File too large"]
    assert repair(path).messages > 500


def test_an_unwritable_path_is_rejected(tmp_path: Path) -> None:
    """A folder that is a file gives a typed error."""
    (tmp_path / "file").touch()
    with pytest.raises(RecordingError, match="cannot be written"):
        RunWriter(tmp_path / "file" / "run.mcap", None)


def test_a_type_without_definition_is_rejected_by_name(tmp_path: Path) -> None:
    """The error names the type, and recording continues."""
    with RunWriter(tmp_path / "run.mcap", None) as writer:
        with pytest.raises(RecordingError, match="sensor_msgs/msg/Nothing"):
            writer.add("/a", "sensor_msgs/msg/Nothing", 0, 0, b"")
        with pytest.raises(RecordingError, match="not a message type"):
            writer.add("/a", "sensor_msgs/srv/SetCameraInfo", 0, 0, b"")
        writer.add("/a", JOINT_STATE, 0, 0, joint_state(0))
    assert Run.open(tmp_path).topics == {"/a": JOINT_STATE}


def test_definitions_are_found_in_overlays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Packages of a sourced workspace (AMENT_PREFIX_PATH) are found, with all they contain."""
    folder = tmp_path / "share" / "my_msgs" / "msg"
    folder.mkdir(parents=True)
    (folder / "Inner.msg").write_text("byte OK=0\nstring<=10 text 'hi'\n")
    (folder / "Outer.msg").write_text("std_msgs/Header header\nInner[<=3] inner # Nothing here\n")
    monkeypatch.setenv("AMENT_PREFIX_PATH", os.pathsep.join([str(tmp_path), "/nowhere"]))
    text = definition("my_msgs/msg/Outer")
    parts = [part.strip() for part in text.split("=" * 80)]
    assert parts[0].startswith("std_msgs/Header header")
    assert [part.splitlines()[0] for part in parts[1:]] == [
        "MSG: std_msgs/Header",
        "MSG: my_msgs/Inner",
        "MSG: builtin_interfaces/Time",
    ]
