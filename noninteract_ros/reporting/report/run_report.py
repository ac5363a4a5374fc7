# SPDX-License-Identifier: Apache-2.0
"""The content of a report: metrics, checks and the files that were written."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from noninteract_ros.reporting.checks.checks import Check


@dataclass(frozen=True)
class Report:
    """What a run showed.

    Attributes:
        metrics: Content of `metrics.json`; units are in the keys.
        checks: What the run must show.
        files: What was written.
        missing: Why a figure could not be drawn, one text each.
    """

    metrics: dict[str, Any]
    checks: tuple[Check, ...]
    files: tuple[Path, ...]
    missing: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether no check failed; those that do not apply do not count."""
        return all(check.passed is not False for check in self.checks)

    @property
    def failures(self) -> tuple[Check, ...]:
        """The checks that failed."""
        return tuple(check for check in self.checks if check.passed is False)
