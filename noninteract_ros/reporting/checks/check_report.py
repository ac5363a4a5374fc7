# SPDX-License-Identifier: Apache-2.0
"""What a check found: facts and claims, as tables for a terminal and as a dictionary for JSON."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.table import Table

from noninteract_ros.reporting.checks.checks import Check


@dataclass(frozen=True)
class Section:
    """One table of a report: a row per thing, a cell per column."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]


@dataclass(frozen=True)
class CheckReport:
    """What a check found.

    Attributes:
        target: What was checked.
        sections: Facts, to read.
        checks: Claims against limits.
        warnings: What is allowed but hardly meant.
        brief: Whether tables leave out the claims that hold, as the sections show them.
    """

    target: str
    sections: tuple[Section, ...]
    checks: tuple[Check, ...]
    warnings: tuple[str, ...]
    brief: bool = False

    @property
    def passed(self) -> bool:
        """Whether no claim fails."""
        return all(check.passed is not False for check in self.checks)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "target": self.target,
            "passed": self.passed,
            "warnings": list(self.warnings),
            "checks": [check.as_dict() for check in self.checks],
        } | {
            section.title: [
                {name: _plain(cell) for name, cell in zip(section.columns, row, strict=True)}
                for row in section.rows
            ]
            for section in self.sections
        }

    def tables(self) -> list[Table]:
        """For a terminal."""
        tables = [_table(section) for section in self.sections]
        shown = [check for check in self.checks if not (self.brief and check.passed)]
        return [*tables, _claims(shown)] if shown else tables


def _plain(cell: Any) -> Any:
    return cell.tolist() if isinstance(cell, np.ndarray) else cell


def _table(section: Section) -> Table:
    table = Table(title=section.title.capitalize(), title_justify="left")
    for name, cell in zip(section.columns, section.rows[0], strict=True):
        table.add_column(name, justify="left" if isinstance(cell, (str, tuple)) else "right")
    for row in section.rows:
        table.add_row(*(_words(cell) for cell in row))
    return table


def _words(cell: Any) -> str:
    """A cell in words; of many numbers their range, of many names the first."""
    if isinstance(cell, np.ndarray):
        if not cell.size:
            return "-"
        low, high = f"{cell.min():.4g}", f"{cell.max():.4g}"
        return low if low == high else f"{low} to {high}"
    if isinstance(cell, tuple):
        return ", ".join(cell if len(cell) <= 8 else (*cell[:4], f"... {len(cell)} in all"))
    return f"{cell:.6g}" if isinstance(cell, float) else str(cell)


def _claims(checks: Sequence[Check]) -> Table:
    table = Table(title="Checks", title_justify="left")
    for name in ("claim", "found", "limit", ""):
        table.add_column(name, justify="right" if name in ("found", "limit") else "left")
    verdicts = {True: "[green]pass[/]", False: "[bold red]FAIL[/]", None: "does not apply"}
    for check in checks:
        bound = ">=" if check.at_least else "<="
        found = "-" if check.value is None else f"{check.value:.6g}"
        limit = f"{bound} {check.limit:.6g} {check.unit}".strip()
        table.add_row(check.name, found, limit, verdicts[check.passed])
    return table
