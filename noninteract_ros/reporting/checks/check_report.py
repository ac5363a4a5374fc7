# SPDX-License-Identifier: Apache-2.0
"""Report of facts and checks, as tables for the terminal and as a dictionary for JSON."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.table import Table

from noninteract_ros.reporting.checks.checks import Check


@dataclass(frozen=True)
class Section:
    """One table of a report.

    Attributes:
        title: Title of the table and key in JSON.
        columns: Column headers.
        rows: One cell per column; arrays are shown by their range.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]


@dataclass(frozen=True)
class CheckReport:
    """Facts, checks and warnings about a target.

    Attributes:
        target: Name of the target.
        sections: Tables of facts.
        checks: Checks against limits.
        warnings: Allowed but doubtful settings.
        brief: True to show only checks that did not pass.
    """

    target: str
    sections: tuple[Section, ...]
    checks: tuple[Check, ...]
    warnings: tuple[str, ...]
    brief: bool = False

    @property
    def passed(self) -> bool:
        """True if no check failed."""
        return all(check.passed is not False for check in self.checks)

    def as_dict(self) -> dict[str, Any]:
        """Return the report as a dictionary for JSON."""
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
        """Return the report as tables for the terminal."""
        tables = [_table(section) for section in self.sections]
        shown = [check for check in self.checks if not (self.brief and check.passed)]
        return [*tables, _checks_table(shown)] if shown else tables


def _plain(cell: Any) -> Any:
    return cell.tolist() if isinstance(cell, np.ndarray) else cell


def _table(section: Section) -> Table:
    table = Table(title=section.title.capitalize(), title_justify="left")
    for name, cell in zip(section.columns, section.rows[0], strict=True):
        table.add_column(name, justify="left" if isinstance(cell, (str, tuple)) else "right")
    for row in section.rows:
        table.add_row(*(_format(cell) for cell in row))
    return table


def _format(cell: Any) -> str:
    """Format a cell: arrays by their range, long tuples by their first entries."""
    if isinstance(cell, np.ndarray):
        if not cell.size:
            return "-"
        low, high = f"{cell.min():.4g}", f"{cell.max():.4g}"
        return low if low == high else f"{low} to {high}"
    if isinstance(cell, tuple):
        return ", ".join(cell if len(cell) <= 8 else (*cell[:4], f"... {len(cell)} in all"))
    return f"{cell:.6g}" if isinstance(cell, float) else str(cell)


def _checks_table(checks: Sequence[Check]) -> Table:
    table = Table(title="Checks", title_justify="left")
    for name in ("check", "value", "limit", ""):
        table.add_column(name, justify="right" if name in ("value", "limit") else "left")
    results = {True: "[green]passed[/]", False: "[bold red]FAILED[/]", None: "n/a"}
    for check in checks:
        bound = ">=" if check.at_least else "<="
        value = "-" if check.value is None else f"{check.value:.6g}"
        limit = f"{bound} {check.limit:.6g} {check.unit}".strip()
        table.add_row(check.name, value, limit, results[check.passed])
    return table
