# SPDX-License-Identifier: Apache-2.0
"""Report of a run: metrics and figures computed from its recording."""

import json
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from noninteract_ros.errors import RecordingError
from noninteract_ros.reporting.checks.checks import Check
from noninteract_ros.reporting.figures.figures import draw
from noninteract_ros.reporting.recording.recorded import Recorded
from noninteract_ros.reporting.recording.run import Run
from noninteract_ros.reporting.rehearsed.compliance import compare_laws, laws_metrics
from noninteract_ros.reporting.rehearsed.processes import in_background
from noninteract_ros.reporting.rehearsed.rehearsals import MIN_PARALLEL_TICKS
from noninteract_ros.reporting.rehearsed.storage_order import storage_orders
from noninteract_ros.reporting.report.metrics import Findings, measure

METRICS_NAME = "metrics.json"


@dataclass(frozen=True)
class Report:
    """Metrics, checks and files of a run.

    Attributes:
        metrics: Content of `metrics.json`; units are in the keys.
        checks: Checks of the run.
        files: Files written.
        missing: Reason for each missing figure.
    """

    metrics: dict[str, Any]
    checks: tuple[Check, ...]
    files: tuple[Path, ...]
    missing: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """True if no check failed; inapplicable checks do not count."""
        return all(check.passed is not False for check in self.checks)

    @property
    def failures(self) -> tuple[Check, ...]:
        """Failed checks."""
        return tuple(check for check in self.checks if check.passed is False)


def write_report(
    run_path: Path,
    out: Path | None = None,
    *,
    other_laws: bool = True,
    compare: bool = False,
) -> Report:
    """Write metrics and figures of a run.

    Long runs are rehearsed in separate processes: the calling program must be importable without
    side effects (`if __name__ == "__main__"`).

    Args:
        run_path: Recording, or the folder with its `run.mcap`.
        out: Folder for `metrics.json` and the figures; None uses the recording's folder.
        other_laws: True to rehearse the scenario under other laws for comparison.
        compare: True to rehearse the whole run under each law, under plain compliance control and
            at other rates; takes minutes for arms.

    Raises:
        RecordingError: The recording cannot be read or analysed, or the folder cannot be written.
    """
    run = Run.open(run_path)
    recorded = Recorded(run)
    folder = out or run.path.parent
    parallel = len(recorded.t) >= MIN_PARALLEL_TICKS
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with in_background(_draw, (run.path, folder), parallel) as figures_of:
            findings = measure(recorded, other_laws)
            if compare:
                _compare(recorded, findings)
            report = Report(metrics=findings.metrics, checks=tuple(findings.checks), files=())
            path = _write_metrics(report, folder / METRICS_NAME)
            figures, missing = figures_of()
    except OSError as error:
        raise RecordingError(f"{folder}: cannot be written: {error.strerror}") from error
    return replace(report, files=(path, *figures), missing=tuple(missing))


def _draw(path: Path, folder: Path) -> tuple[list[Path], list[str]]:
    """Draw all figures; reads the recording again instead of pickling it."""
    return draw(Recorded(Run.open(path)), folder)


def _write_metrics(report: Report, path: Path) -> Path:
    checks = [check.as_dict() for check in report.checks]
    metrics = _finite(report.metrics | {"checks": checks, "passed": report.passed})
    path.write_text(json.dumps(metrics, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    return path


def _compare(recorded: Recorded, findings: Findings) -> None:
    """Add the comparison of laws and of rates over the duration of the run."""
    scenario, duration = recorded.scenario, float(recorded.t[-1] - recorded.t[0])
    findings.metrics["laws"] = laws_metrics(compare_laws(scenario, duration), duration)
    findings.metrics["storage_order"], checks = storage_orders(scenario, duration)
    findings.checks.extend(checks)


def _finite(value: Any) -> Any:
    """Replace non-finite numbers by None, since JSON cannot represent them."""
    if isinstance(value, dict):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
