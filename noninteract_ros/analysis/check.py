# SPDX-License-Identifier: Apache-2.0
"""`noninteract check`: what can be said of a scenario, or of the law, before anything moves."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from noninteract_ros.analysis.check_report import CheckReport, CheckSettings, Section
from noninteract_ros.analysis.checks import at_least, at_most
from noninteract_ros.analysis.delay import delay_check
from noninteract_ros.analysis.identities import identities
from noninteract_ros.analysis.identity_check import check_identities
from noninteract_ros.analysis.law_probe import LawProbe
from noninteract_ros.control.sampled_loops import MARGINAL, Loop, closed_loops
from noninteract_ros.errors import ScenarioError
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario_file import find_scenario, load_scenario

STATES = 20  # random states, unless another number is asked for
SINGULAR = 1e-6  # smallest singular value below which the subtasks count as dependent


def _gauntlet(settings: CheckSettings) -> CheckReport:
    from noninteract_ros.analysis.gauntlet.check import check_gauntlet  # Loads the compiler.

    return check_gauntlet(settings.gauntlet)


# Checks with names of their own; they choose or are given scenarios.
BUILT_IN: dict[str, Callable[[CheckSettings], CheckReport]] = {
    "identities": check_identities,
    "delay": delay_check,
    "gauntlet": _gauntlet,
}


def run_check(target: str, settings: CheckSettings, others: Sequence[str] = ()) -> CheckReport:
    """Runs a built-in check, or checks the scenario of that name or file.

    Args:
        target: Name of a built-in check, or a scenario.
        settings: What a user can choose.
        others: Scenarios for a built-in check.

    Raises:
        ScenarioError: The target is neither, or a scenario is wrong.
    """
    if target in BUILT_IN:
        return BUILT_IN[target](replace(settings, scenarios=tuple(others)))
    if others:
        raise ScenarioError(
            "scenario", f"{1 + len(others)} of them", "one, or a check's name first"
        )
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
            at_most(f"growth per tick, {loop.name}", loop.growth, 1.0 + MARGINAL, "")
            for loop in loops
        ),
        *identities(probe, settings.samples or STATES, settings.seed),
    ]
    scenario_row = (mode.law, rate, len(team.names), team.n, sum(t.dim for t in stack.subtasks))
    columns = ("law", "rate [Hz]", "robots", "joints", "coordinates")
    sections = (
        Section("scenario", columns, (scenario_row,)),
        _robots(team.names, team.joint_names),
        _subtasks(scenario, stack.subtasks, dynamics.inertias),
        _loops(loops),
    )
    warnings = tuple(text for loop in loops if (text := loop.warning()))
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
