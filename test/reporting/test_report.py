# SPDX-License-Identifier: Apache-2.0
"""Report of a run from its recording."""

import json
from pathlib import Path

import numpy as np
import pytest
from rehearsed import record, scenario_values
from rich.console import Console

from noninteract_ros import cli
from noninteract_ros.errors import RecordingError
from noninteract_ros.reporting.recording.writer import RunWriter
from noninteract_ros.reporting.report.report import write_report
from noninteract_ros.reporting.report.tables import summary, tables


def shown(report) -> str:
    console = Console(width=160, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    for table in tables(report):
        console.print(table)
    return console.export_text()


def test_a_report_holds_metrics_checks_and_figures(tmp_path: Path) -> None:
    """All files are in the requested folder, and `metrics.json` agrees with the report."""
    record(tmp_path, scenario_values(), 1.2)
    report = write_report(tmp_path, tmp_path / "out")
    assert report.passed
    assert not report.failures
    assert {file.name for file in report.files} == {
        file.name for file in (tmp_path / "out").iterdir()
    }
    stored = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert stored["passed"] is True
    assert [check["name"] for check in stored["checks"]] == [c.name for c in report.checks]
    assert stored["closed_form"]["relative"]["max_deviation_m"] < 2e-3
    assert set(stored["comparison"]["moved"]) == {"energy_gated", "natural"}
    passed, count = sum(check.passed is True for check in report.checks), len(report.checks)
    assert summary(report) == f"{passed} of {count} checks passed, {count - passed} do not apply"
    text = shown(report)
    for word in ("closed_form.relative", "passed", "n/a", "max error", "natural"):
        assert word in text


def test_a_report_is_reproducible(tmp_path: Path) -> None:
    """Two reports of a run in its own folder are equal."""
    run = record(tmp_path, scenario_values(), 0.6)
    texts = []
    for _ in range(2):
        write_report(run.path, other_laws=False)
        texts.append((tmp_path / "metrics.json").read_text())
    assert texts[0] == texts[1]


def test_a_broken_run_does_not_pass(tmp_path: Path) -> None:
    """Failed checks are listed, and non-finite numbers are null."""

    def spoil(topic: str, time: float, arrays: list[np.ndarray]) -> list[np.ndarray]:
        if topic == "joint_states" and time == 0.2:
            arrays[1] = arrays[1] * np.nan
        return arrays

    record(tmp_path, scenario_values(), 0.4, spoil)
    report = write_report(tmp_path, other_laws=False)
    assert not report.passed
    assert "reproduction" in {check.name for check in report.failures}
    text = (tmp_path / "metrics.json").read_text()
    assert "NaN" not in text
    assert "Infinity" not in text
    assert json.loads(text)["passed"] is False
    assert "FAILED" in shown(report)
    assert "failed:[/] complete.numbers_not_finite, reproduction" in summary(report)


def test_a_missing_recording_is_rejected(tmp_path: Path) -> None:
    """The error names the file."""
    with pytest.raises(RecordingError, match=r"run\.mcap"):
        write_report(tmp_path)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "no run.mcap in this folder"),
        (b"", "is empty"),
        (b"hello", "is not an MCAP file"),
        ("cut", "try: noninteract repair"),
        ("no scenario", "no scenario: the run cannot be analysed"),
    ],
)
def test_an_unreadable_recording_gives_one_line_and_exit_status_2(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    content: bytes | str | None,
    reason: str,
) -> None:
    """The line names the file and the error."""
    file = tmp_path / "run.mcap"
    if isinstance(content, bytes):
        file.write_bytes(content)
    elif content == "cut":
        record(tmp_path, scenario_values(), 0.1)
        file.write_bytes(file.read_bytes()[:-2000])
    elif content:
        RunWriter(file, None).close()
    monkeypatch.setattr("sys.argv", ["noninteract", "report", str(tmp_path)])
    assert cli.main() == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"noninteract: {tmp_path}")
    assert reason in line


def test_errors_have_their_own_units(tmp_path: Path) -> None:
    """Revolute and prismatic joints have separate rows in tables and in the file."""
    joints = ["arm/joint_1", "arm/joint_2", "mass/x", "mass/y"]
    values = {
        "robots": ["arm", "mass"],
        "arm": {
            "model": "planar_arm",
            "link_lengths": [0.5, 0.5],
            "link_masses": [1.0, 1.0],
            "initial_position": [0.4, 0.5],
        },
        "mass": {"mass": 1.0},
        "subtasks": ["all"],
        "all": {"kind": "posture", "joints": joints, "stiffness": [9.0], "damping": [6.0]},
        "planner": {"subtask": "all", "formations": ["to"], "to": {"value": [0.5, 0.5, 0.0, 0.2]}},
    }
    values["all"] |= {"authority": "autonomy", "takeover": "direct"}
    record(tmp_path, values, 0.3)
    report = write_report(tmp_path, other_laws=False)
    found = report.metrics["tracking"]["all"]
    assert found["max_error_rad"] == pytest.approx(0.1, rel=1e-2)
    assert found["max_error_m"] == pytest.approx(0.2, rel=1e-2)
    moved = report.metrics["comparison"]["moved"]["energy_gated"]["autonomy"]["all"]
    assert set(moved) == {"rad", "m"}
    rows = [line.split("│")[1:4] for line in shown(report).splitlines() if "│ all" in line]
    cells = [[cell.strip() for cell in row] for row in rows]
    assert cells[0][:2] == ["all", "m"]
    assert cells[1][:2] == ["all", "rad"]
    check = next(check for check in report.checks if check.name == "reproduction")
    assert check.unit == "m, rad, m/s, rad/s"
