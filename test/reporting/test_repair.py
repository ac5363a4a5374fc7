# SPDX-License-Identifier: Apache-2.0
"""Repair keeps all complete messages of truncated and damaged files."""

from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from noninteract_ros.errors import RecordingError
from noninteract_ros.reporting.recording.repair import repair
from noninteract_ros.reporting.recording.run import Run
from noninteract_ros.reporting.recording.writer import RunWriter

JOINT_STATE = "sensor_msgs/msg/JointState"
MESSAGES = 60


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A finished file with two topics in six chunks."""
    rng = np.random.default_rng(5)
    path = tmp_path / "run.mcap"
    with RunWriter(path, "rate: 1000.0") as writer:
        for number in range(MESSAGES):
            writer.add(f"/{number % 2}", JOINT_STATE, number, number, rng.bytes(40), number)
            if number % 10 == 9:
                writer.flush()
    return path


def numbers(path: Path) -> list[int]:
    """Return the sequence numbers of a file, read by the standard MCAP reader."""
    with path.open("rb") as stream:
        return [message.sequence for _, _, message in make_reader(stream).iter_messages()]


def test_a_cut_anywhere_keeps_the_chunks_before_it(recording: Path, tmp_path: Path) -> None:
    """For each length of the file the result is complete, in order, and of maximal length."""
    whole = recording.read_bytes()
    rng = np.random.default_rng(6)
    kept = []
    cuts = {1, 7, 8, 9, 20, len(whole) - 8, len(whole) - 1, *rng.integers(9, len(whole), 80)}
    for cut in sorted(int(cut) for cut in cuts):
        path = tmp_path / "cut.mcap"
        path.write_bytes(whole[:cut])
        report = repair(path)
        found = numbers(path)
        assert found == list(range(report.messages))
        assert report.messages % 10 == 0
        assert not report.intact
        assert report.lost_bytes <= cut
        kept.append(report.messages)
    assert kept == sorted(kept)
    assert (kept[0], kept[-1]) == (0, MESSAGES)


def test_the_scenario_survives_a_cut(recording: Path) -> None:
    """It is stored before all messages."""
    recording.write_bytes(recording.read_bytes()[:400])
    assert repair(recording.parent).messages == 0
    assert Run.open(recording).scenario == "rate: 1000.0"


def test_an_intact_file_is_unchanged(recording: Path, tmp_path: Path) -> None:
    """A copy is written only if requested."""
    before = recording.read_bytes()
    report = repair(recording)
    assert report.intact
    assert report.messages == MESSAGES
    assert recording.read_bytes() == before
    assert repair(recording, tmp_path / "copy.mcap").path == tmp_path / "copy.mcap"
    assert numbers(tmp_path / "copy.mcap") == list(range(MESSAGES))


def test_damage_in_the_middle_costs_one_chunk(recording: Path) -> None:
    """A chunk with a wrong checksum is skipped, and all others are kept."""
    data = bytearray(recording.read_bytes())
    at = data.index(b"zstd", data.index(b"zstd") + 4)
    data[at + 30] ^= 0xFF
    recording.write_bytes(data)
    with pytest.raises(RecordingError, match=r"damaged.*noninteract repair"):
        Run.open(recording)
    report = repair(recording)
    assert numbers(recording) == [n for n in range(MESSAGES) if not 10 <= n < 20]
    assert len(report.reasons) == 1
    assert "damaged" in report.reasons[0]


def test_a_damaged_scenario_costs_no_message(recording: Path) -> None:
    """A scenario with a wrong checksum is skipped and reported."""
    data = recording.read_bytes().replace(b"rate: 1000.0", b"rate: 9000.0", 1)
    recording.write_bytes(data)
    report = repair(recording)
    assert report.messages == MESSAGES
    assert "an attachment" in str(report)
    assert Run.open(recording).scenario is None


def test_a_tail_of_zeros_is_cut(recording: Path) -> None:
    """A file with a gap after a system crash is truncated at the gap."""
    data = recording.read_bytes()
    recording.write_bytes(data[: len(data) // 2] + bytes(5000))
    report = repair(recording)
    assert 0 < report.messages < MESSAGES
    assert report.lost_bytes >= 5000


def test_foreign_content_is_kept(tmp_path: Path) -> None:
    """Metadata, attachments and channel metadata of another writer are kept."""
    stream = BytesIO()
    writer = Writer(stream, use_chunking=False)
    writer.start("other", "other")
    writer.add_metadata("about", {"who": "me"})
    channel = writer.register_channel("/plain", "json", 0, {"key": "value"})
    writer.add_message(channel, 1, b"{}", 2, 3)
    writer.add_attachment(1, 2, "note.txt", "text/plain", b"hello")
    writer.finish()
    path = tmp_path / "run.mcap"
    path.write_bytes(stream.getvalue()[:-5])
    assert repair(path).messages == 1
    with path.open("rb") as file:
        reader = make_reader(file)
        assert reader.get_header().profile == "other"
        assert [item.metadata for item in reader.iter_metadata()] == [{"who": "me"}]
        assert [item.data for item in reader.iter_attachments()] == [b"hello"]
        ((schema, found, message),) = reader.iter_messages()
    assert schema is None
    assert found.metadata == {"key": "value"}
    assert (message.log_time, message.publish_time, message.sequence) == (1, 2, 3)


def test_files_that_are_no_recordings_are_rejected_unchanged(tmp_path: Path) -> None:
    """Missing, empty and foreign files raise errors, and no other file remains."""
    path = tmp_path / "run.mcap"
    with pytest.raises(RecordingError, match="no such file"):
        repair(path)
    for content, reason in [(b"", "is empty"), (b"not MCAP at all", "is not an MCAP file")]:
        path.write_bytes(content)
        with pytest.raises(RecordingError, match=reason):
            repair(path)
        assert path.read_bytes() == content
    assert list(tmp_path.iterdir()) == [path]
