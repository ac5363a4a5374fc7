# SPDX-License-Identifier: Apache-2.0
"""The report of a run, from its recording alone."""

import json
from pathlib import Path

import numpy as np
import pytest
from rehearsed import record, scenario_values
from rich.console import Console

from noninteract_ros.analysis.report import tables, write_report
from noninteract_ros.errors import RecordingError


def shown(report) -> str:
    console = Console(width=160, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    for table in tables(report):
        console.print(table)
    return console.export_text()


def test_a_report_holds_metrics_checks_and_figures(tmp_path: Path) -> None:
    """Everything lands in the folder asked for, and the file says what the report says."""
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
    assert set(stored["comparison"]["moved_m"]) == {"energy_gated", "natural"}
    text = shown(report)
    for word in ("closed_form.relative", "passed", "n/a", "max error [m]", "natural [m]"):
        assert word in text


def test_a_report_is_the_same_each_time(tmp_path: Path) -> None:
    """By default it lies beside the recording, and two of the same run are equal."""
    run = record(tmp_path, scenario_values(), 0.6)
    texts = []
    for _ in range(2):
        write_report(run.path, other_laws=False)
        texts.append((tmp_path / "metrics.json").read_text())
    assert texts[0] == texts[1]


def test_a_broken_run_does_not_pass(tmp_path: Path) -> None:
    """The failures are listed, and numbers that are none are null."""

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


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    """The error names the file."""
    with pytest.raises(RecordingError, match=r"run\.mcap"):
        write_report(tmp_path)
