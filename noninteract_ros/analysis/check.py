# SPDX-License-Identifier: Apache-2.0
"""`noninteract check`: what can be said of a scenario, or of the law, before anything moves."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.table import Table

from noninteract_ros.analysis.checks import Check, at_least, at_most
from noninteract_ros.analysis.identities import LawProbe, identities
from noninteract_ros.analysis.loops import Loop, closed_loops
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario_file import find_scenario, load_scenario

SINGULAR = 1e-6  # smallest singular value below which the subtasks count as dependent
MARGINAL = 1e-9  # growth beyond 1 that rounding may cause where a mode neither grows nor decays


@dataclass(frozen=True)
class CheckSettings:
    """What a user can choose.

    Attributes:
        samples: Number of random states.
        seed: Seed of the random states.
    """

    samples: int = 20
    seed: int = 0


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
    """

    target: str
    sections: tuple[Section, ...]
    checks: tuple[Check, ...]
    warnings: tuple[str, ...]

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
        return [*tables, _claims(self.checks)] if self.checks else tables


# Checks that need no scenario, by name.
BUILT_IN: dict[str, Callable[[CheckSettings], CheckReport]] = {}


def run_check(target: str, settings: CheckSettings) -> CheckReport:
    """Runs a built-in check, or checks the scenario of that name or file.

    Raises:
        ScenarioError: The target is neither, or the scenario is wrong.
    """
    if target in BUILT_IN:
        return BUILT_IN[target](settings)
    path = find_scenario(target)
    return check_scenario(str(path), load_scenario(path), settings)


def check_scenario(name: str, scenario: Scenario, settings: CheckSettings) -> CheckReport:
    """Dimensions, modes and the identities of the law for a scenario's team."""
    team = scenario.build_team()
    stack = scenario.build_stack(team)
    mode = scenario.build_controller(team, stack).mode
    probe = LawProbe(team, stack, mode.impedance)
    dynamics = probe.dynamics(team.state(team.q0, np.zeros(team.n)))
    smallest = float(np.linalg.svd(dynamics.J, compute_uv=False)[-1])
    rate = scenario.general.rate
    loops = closed_loops(mode.law, dynamics, mode.impedance, stack.names, rate)
    checks = [
        at_least("smallest singular value at the initial state", smallest, SINGULAR, ""),
        *(
            at_most(f"growth per tick, {loop.name}", loop.growth, 1 + MARGINAL, "")
            for loop in loops
        ),
        *identities(probe, settings.samples, settings.seed),
    ]
    scenario_row = (mode.law, rate, len(team.names), team.n, sum(t.dim for t in stack.subtasks))
    columns = ("law", "rate [Hz]", "robots", "joints", "coordinates")
    sections = (
        Section("scenario", columns, (scenario_row,)),
        _robots(team.names, team.joint_names),
        _subtasks(scenario, stack.subtasks, dynamics.inertias),
        _loops(loops),
    )
    warnings = tuple(text for loop in loops if (text := loop.warning(rate)))
    return CheckReport(name, sections, tuple(checks), warnings)


def _robots(names: tuple[str, ...], joints: tuple[str, ...]) -> Section:
    own = [
        tuple(joint.partition("/")[2] for joint in joints if joint.startswith(f"{name}/"))
        for name in names
    ]
    rows = tuple((name, len(mine), mine) for name, mine in zip(names, own, strict=True))
    return Section("robots", ("robot", "joints", "names"), rows)


def _subtasks(scenario: Scenario, subtasks: Any, inertias: Any) -> Section:
    rows = tuple(
        (
            task.name,
            task.dim,
            task.elements,
            (*task.axes, "rotation") if task.rotates else task.axes,
            scenario.subtasks[task.name].input.authority,
            np.linalg.eigvalsh(inertia),
        )
        for task, inertia in zip(subtasks, inertias, strict=True)
    )
    columns = ("subtask", "coordinates", "elements", "axes", "authority", "inertia M_i [kg]")
    return Section("subtasks", columns, rows)


def _loops(loops: list[Loop]) -> Section:
    rows = tuple(
        (loop.name, loop.damping_ratios, loop.slowest, loop.fastest, loop.ticks, loop.growth)
        for loop in loops
    )
    columns = ("loop", "damping ratios", "slowest [1/s]", "fastest [1/s]")
    return Section("loops", (*columns, "ticks per time constant", "growth per tick"), rows)


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


def _claims(checks: tuple[Check, ...]) -> Table:
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
