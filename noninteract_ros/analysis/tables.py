# SPDX-License-Identifier: Apache-2.0
"""A report as tables for the terminal."""

from typing import TYPE_CHECKING, Any

from rich.table import Column, Table

from noninteract_ros.analysis.checks import Check

if TYPE_CHECKING:
    from noninteract_ros.analysis.report import Report


def tables(report: "Report") -> list[Table]:
    """Checks, tracking and the comparison of laws."""
    return [
        checks_table(report.checks),
        tracking_table(report.metrics),
        *crossing_tables(report.metrics),
        *([laws_table(report.metrics["laws"])] if "laws" in report.metrics else []),
        *storage_tables(report.metrics.get("storage_order", {})),
    ]


def checks_table(checks: tuple[Check, ...]) -> Table:
    """A row for each check; what does not apply says why."""
    titles = ("check", "found", "bound", "unit", "")
    table = Table(*(Column(title, no_wrap=True) for title in titles), caption_justify="left")
    words = {True: "[green]passed[/]", False: "[bold red]FAILED[/]", None: "[dim]n/a[/]"}
    for check in checks:
        sign = ">=" if check.at_least else "<="
        limit = f"{sign} {check.limit:.3g}"
        found = _number(check.value)
        table.add_row(check.name, found, limit, check.unit, words[check.passed])
    reasons = dict.fromkeys(check.reason for check in checks if check.passed is None)
    table.caption = "\n".join(f"n/a: {reason}" for reason in reasons) or None
    return table


def tracking_table(metrics: dict[str, Any]) -> Table:
    """Errors and the closed form's deviation, a row for each subtask."""
    columns = ("max error", "rms error", "final error", "off the closed form")
    table = Table("subtask", *(f"{name} [m]".replace("[", r"\[") for name in columns))
    for name, found in metrics["tracking"].items():
        keys = ("max_error_m", "rms_error_m", "final_error_m")
        deviation = metrics["closed_form"].get(name, {}).get("max_deviation_m")
        numbers = [*(found.get(key) for key in keys), deviation]
        table.add_row(name, *(_number(value) for value in numbers))
    return table


def crossing_tables(metrics: dict[str, Any]) -> list[Table]:
    """How far each source moves each subtask, by law; none without sources."""
    comparison = metrics["comparison"]
    laws = comparison["moved_m"]
    if not comparison["led_by"]:
        return []
    table = Table("moved by", "subtask", *(rf"{law} \[m]" for law in laws))
    for source, owned in comparison["led_by"].items():
        for subtask in metrics["run"]["subtasks"]:
            moved = [laws[law].get(source, {}).get(subtask) for law in laws]
            own = " (its own)" if subtask == owned else ""
            table.add_row(source, subtask + own, *(_number(value) for value in moved))
    return [table]


def laws_table(laws: dict[str, Any]) -> Table:
    """Largest errors under each law, and at each rate."""
    subtasks = list(laws["order_of_fall"])
    table = Table(
        "largest error under", r"rate \[Hz]", *(rf"{name} \[m, rad]" for name in subtasks), "D/M"
    )
    for row in laws["rows"]:
        errors = (row["max_error_m"], row["max_error_rad"])
        cells = (", ".join(_number(error[name]) for error in errors) for name in subtasks)
        law = row["law"] + (" (limits acted)" if row["limits_acted"] else "")
        table.add_row(law, f"{row['rate_Hz']:g}", *cells, _number(row["damping_per_tick"]))
    orders = ", ".join(
        f"{name} {'-' if order is None else format(order, '.2f')}"
        for name, order in laws["order_of_fall"].items()
    )
    table.caption = (
        f"at up to {_number(laws['speed_m_per_s'])} m/s and {_number(laws['turning_rad_per_s'])}"
        f" rad/s for {laws['duration_s']:g} s; order in the tick: {orders}\n"
        "D/M: largest eigenvalue of inertia^-1 D in a tick; held over it, a loop is stable below 2"
    )
    return table


def storage_tables(found: dict[str, Any]) -> list[Table]:
    """What the balance of each storage function misses at each rate; none if nobody looked."""
    rows = [(name, item) for name, item in found.items() if isinstance(item, dict)]
    if not rows:
        return []
    rates = (f"{rate:g} Hz" for rate in rows[0][1]["rate_Hz"])
    table = Table("storage less supply", "", *(rf"{rate} \[J]" for rate in rates), "order")
    for name, item in rows:
        for label, key, order in (
            ("all of it", "missed_J", "order"),
            ("less holding the torque", "unexplained_J", "order_unexplained"),
        ):
            numbers = (*item[key], item[order])
            table.add_row(name, label, *(_number(value) for value in numbers))
    return [table]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"
