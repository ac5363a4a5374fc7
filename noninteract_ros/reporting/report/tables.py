# SPDX-License-Identifier: Apache-2.0
"""A report as tables for the terminal."""

from typing import Any

from rich.table import Column, Table
from rich.text import Text

from noninteract_ros.reporting.checks.checks import Check
from noninteract_ros.reporting.report.report import Report

UNITS = ("m", "rad")


def tables(report: Report) -> list[Table]:
    """Return the tables of checks, notes, tracking errors and comparisons."""
    return [
        checks_table(report.checks),
        notes_table(report.checks),
        tracking_table(report.metrics),
        *cross_motion_tables(report.metrics),
        *([laws_table(report.metrics["laws"])] if "laws" in report.metrics else []),
        *storage_tables(report.metrics.get("storage_order", {})),
    ]


def summary(report: Report) -> str:
    """Return the counts of passed, failed and inapplicable checks as text with markup."""
    verdicts = [check.passed for check in report.checks]
    text = f"{verdicts.count(True)} of {len(verdicts)} checks passed"
    if open_ones := verdicts.count(None):
        text += f", {open_ones} do not apply"
    if report.failures:
        names = ", ".join(check.name for check in report.failures)
        text += f"; [bold red]failed:[/] {names}"
    return text


def checks_table(checks: tuple[Check, ...]) -> Table:
    """Return a row per check; inapplicable checks refer to a numbered note."""
    titles = ("check", "value", "limit", "unit", "")
    table = Table(*(Column(title, no_wrap=True) for title in titles))
    reasons = _reasons(checks)
    for check in checks:
        sign = ">=" if check.at_least else "<="
        word = "[green]passed[/]" if check.passed else "[bold red]FAILED[/]"
        if check.passed is None:
            word = f"[dim]n/a ({reasons.index(check.reason) + 1})[/]"
        limit = "-" if check.passed is None else f"{sign} {check.limit:.3g}"
        table.add_row(check.name, _number(check.value), limit, check.unit, word)
    return table


def notes_table(checks: tuple[Check, ...]) -> Table:
    """Return the numbered reasons why checks do not apply."""
    table = Table.grid(padding=(0, 1))
    for number, reason in enumerate(_reasons(checks), start=1):
        table.add_row(f"n/a ({number}):", Text(reason))
    return table


def _reasons(checks: tuple[Check, ...]) -> list[str]:
    return list(dict.fromkeys(check.reason for check in checks if check.passed is None))


def tracking_table(metrics: dict[str, Any]) -> Table:
    """Return errors and deviation from the closed form, a row per subtask and unit."""
    columns = ("max error", "RMS error", "final error", "closed-form deviation")
    table = Table("subtask", "unit", *columns)
    for name, found in metrics["tracking"].items():
        units = [unit for unit in UNITS if f"max_error_{unit}" in found]
        for unit in units:
            keys = (f"max_error_{unit}", f"rms_error_{unit}", f"final_error_{unit}")
            deviation = metrics["closed_form"].get(name, {}).get(f"max_deviation_{unit}")
            numbers = [*(found[key] for key in keys), deviation]
            table.add_row(name, unit, *(_number(value) for value in numbers))
        if not units:
            table.add_row(name, "", found["reason"])
    return table


def cross_motion_tables(metrics: dict[str, Any]) -> list[Table]:
    """Return the motion of each subtask caused by each source, by law; none without sources."""
    comparison = metrics["comparison"]
    laws = comparison["moved"]
    if not comparison["led_by"]:
        return []
    table = Table("moved by", "subtask", "unit", *laws)
    for source, owned in comparison["led_by"].items():
        for subtask in metrics["run"]["subtasks"]:
            own = " (its own)" if subtask == owned else ""
            moved = [laws[law].get(source, {}).get(subtask, {}) for law in laws]
            for unit in dict.fromkeys(unit for item in moved for unit in item):
                numbers = (_number(item.get(unit)) for item in moved)
                table.add_row(source, subtask + own, unit, *numbers)
    return [table]


def laws_table(laws: dict[str, Any]) -> Table:
    """Return the largest errors under each law and at each rate."""
    kinds = [
        (name, unit)
        for name in laws["convergence_order"]
        for unit in UNITS
        if name in laws["rows"][0][f"max_error_{unit}"]
    ]
    titles = (rf"{name} \[{unit}]" for name, unit in kinds)
    table = Table("law", r"rate \[Hz]", *titles, "D/M", caption_justify="left")
    for row in laws["rows"]:
        cells = (_number(row[f"max_error_{unit}"][name]) for name, unit in kinds)
        law = row["law"] + (" (limits active)" if row["limits_acted"] else "")
        table.add_row(law, f"{row['rate_Hz']:g}", *cells, _number(row["damping_per_tick"]))
    orders = ", ".join(
        f"{name} {'-' if order is None else format(order, '.2f')}"
        for name, order in laws["convergence_order"].items()
    )
    table.caption = (
        f"largest errors at up to {_number(laws['speed_m_per_s'])} m/s and "
        f"{_number(laws['turning_rad_per_s'])} rad/s for {laws['duration_s']:g} s; "
        f"order in the tick: {orders}\n"
        "D/M: largest eigenvalue of inertia^-1 D times the tick; sampled loops are stable below 2"
    )
    return table


def storage_tables(found: dict[str, Any]) -> list[Table]:
    """Return residuals of the storage balances at each rate; none if not computed."""
    rows = [(name, item) for name, item in found.items() if isinstance(item, dict)]
    if not rows:
        return []
    rates = (f"{rate:g} Hz" for rate in rows[0][1]["rate_Hz"])
    table = Table("storage residual", "", *(rf"{rate} \[J]" for rate in rates), "order")
    for name, item in rows:
        for label, key, order in (
            ("total", "missed_J", "order"),
            ("without hold work", "unexplained_J", "order_unexplained"),
        ):
            numbers = (*item[key], item[order])
            table.add_row(name, label, *(_number(value) for value in numbers))
    return [table]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"
