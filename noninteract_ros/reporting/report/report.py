# SPDX-License-Identifier: Apache-2.0
"""Metrics and figures of a run, from its recording alone."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

from noninteract_ros.errors import RecordingError
from noninteract_ros.reporting.figures.figures import draw
from noninteract_ros.reporting.recording.recorded import Recorded
from noninteract_ros.reporting.recording.run import Run
from noninteract_ros.reporting.rehearsed.compliance import compare_laws, laws_metrics
from noninteract_ros.reporting.rehearsed.processes import beside
from noninteract_ros.reporting.rehearsed.rehearsals import SMALL
from noninteract_ros.reporting.rehearsed.storage_order import storage_orders
from noninteract_ros.reporting.report.metrics import Findings, measure
from noninteract_ros.reporting.report.run_report import Report

METRICS_NAME = "metrics.json"


def write_report(
    run_path: Path,
    out: Path | None = None,
    *,
    other_laws: bool = True,
    compare: bool = False,
) -> Report:
    """Measures a run and draws its figures.

    Long runs are rehearsed in processes of their own: a program that calls this must be
    importable without side effects (`if __name__ == "__main__"`).

    Args:
        run_path: Recording, or the folder that holds it as `run.mcap`.
        out: Folder for `metrics.json` and the figures; by default the recording's own.
        other_laws: Whether the scenario is rehearsed under other laws, to compare.
        compare: Whether it is also rehearsed as a whole under each law, under plain compliance
            control and at other rates; for arms that takes minutes.

    Raises:
        RecordingError: The recording cannot be read or analysed, or the folder not be written.
    """
    run = Run.open(run_path)
    recorded = Recorded(run)
    folder = out or run.path.parent
    worth_it = len(recorded.t) >= SMALL
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with beside(_draw, (run.path, folder), worth_it) as drawing:
            findings = measure(recorded, other_laws)
            if compare:
                _compare(recorded, findings)
            report = Report(findings.metrics, tuple(findings.checks), ())
            path = _write_metrics(report, folder / METRICS_NAME)
            figures, missing = drawing()
    except OSError as error:
        raise RecordingError(f"{folder}: cannot be written: {error.strerror}") from error
    return replace(report, files=(path, *figures), missing=tuple(missing))


def _draw(path: Path, folder: Path) -> tuple[list[Path], list[str]]:
    """Draws a recording, read anew: it need not be sent to another process."""
    return draw(Recorded(Run.open(path)), folder)


def _write_metrics(report: Report, path: Path) -> Path:
    checks = [check.as_dict() for check in report.checks]
    metrics = _finite(report.metrics | {"checks": checks, "passed": report.passed})
    path.write_text(json.dumps(metrics, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    return path


def _compare(recorded: Recorded, findings: Findings) -> None:
    """Adds the scenario, as it was run, under each law and at several rates."""
    scenario, duration = recorded.scenario, float(recorded.t[-1] - recorded.t[0])
    findings.metrics["laws"] = laws_metrics(compare_laws(scenario, duration), duration)
    findings.metrics["storage_order"], checks = storage_orders(scenario, duration)
    findings.checks.extend(checks)


def _finite(value: Any) -> Any:
    """The same with null for numbers that are none: JSON has no word for them."""
    if isinstance(value, dict):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
