# SPDX-License-Identifier: Apache-2.0
"""`noninteract check identities`: what the law claims of itself, on the team of each scenario."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from noninteract_ros.errors import ScenarioError
from noninteract_ros.reporting.checks.check_report import CheckReport, Section
from noninteract_ros.reporting.checks.checks import Check
from noninteract_ros.scenario.files import find_scenario, known_scenarios, load_scenario
from noninteract_ros.team.models.urdf_files import INSTALL
from noninteract_ros.validation.identities.identities import IDENTITIES, claims, largest_residuals
from noninteract_ros.validation.identities.law_probe import LawProbe

STATES = 1000  # random states of each team, unless another number is asked for


def check_identities(scenarios: Sequence[str], samples: int | None, seed: int) -> CheckReport:
    """Measures the identities on the teams of scenarios, by default of all that have a name.

    A scenario that was not asked for by name, and whose models of robots are not installed, is
    left out with a warning.

    Raises:
        ScenarioError: A scenario is not found, or is wrong.
    """
    given = {name: find_scenario(name) for name in scenarios}
    count = samples or STATES
    rows, checks, warnings = [], [], []
    for name, path in (given or known_scenarios()).items():
        try:
            row, found = _measure(name, path, count, seed)
        except ScenarioError as error:
            if given or INSTALL not in str(error):
                raise
            warnings.append(f"{name} is left out: {error}")
            continue
        rows.append(row)
        checks += found
    target = f"identities of the law, at {count} random states of each team"
    legend = tuple((item.short, item.name, item.limit) for item in IDENTITIES)
    columns = ("scenario", "redrawn", *(item.short for item in IDENTITIES))
    sections = (
        Section("identities", ("short", "identity", "limit, relative"), legend),
        Section("largest relative residuals", columns, tuple(rows)),
    )
    return CheckReport(target, sections, tuple(checks), tuple(warnings), brief=True)


def _measure(
    name: str, path: Path, count: int, seed: int
) -> tuple[tuple[object, ...], list[Check]]:
    """A row of the table, and the claims, each with the scenario's name."""
    scenario = load_scenario(path)
    team = scenario.build_team()
    stack = scenario.build_stack(team)
    probe = LawProbe(team, stack, scenario.build_controller(team, stack).mode.impedance)
    largest = largest_residuals(probe, count, seed)
    worst = (
        float(np.max([value for (item, _), value in largest.items() if item is identity]))
        for identity in IDENTITIES
    )
    row = (name, probe.refused, *(f"{value:.1e}" for value in worst))
    return row, claims(largest, f"{name}: ")
