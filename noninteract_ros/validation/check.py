# SPDX-License-Identifier: Apache-2.0
"""`noninteract check`: static checks of a scenario or of the law."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from noninteract_ros.control.law.decoupling import TaskDynamics
from noninteract_ros.control.law.impedance import Impedance
from noninteract_ros.control.safety.torque_limiter import RATE_SHARE, rate_demand
from noninteract_ros.control.stability.sampled_loops import MARGINAL, Loop, closed_loops
from noninteract_ros.errors import ScenarioError
from noninteract_ros.reporting.checks.check_report import CheckReport, Section
from noninteract_ros.reporting.checks.checks import at_least, at_most
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import find_scenario, load_scenario
from noninteract_ros.team.team import Team
from noninteract_ros.validation.delay import check_delay
from noninteract_ros.validation.gauntlet.settings import GauntletSettings
from noninteract_ros.validation.identities.identities import check_identities, identities
from noninteract_ros.validation.identities.law_probe import LawProbe

STATES = 20  # default number of random states
NEAREST = 5  # number of listed pairs of bodies
SINGULAR = 1e-6  # smallest singular value of independent subtasks


@dataclass(frozen=True)
class CheckSettings:
    """Options of a check.

    Attributes:
        samples: Number of random states; None uses the default of the check.
        seed: Seed of the random states.
        gauntlet: Options of the gauntlet.
    """

    samples: int | None = None
    seed: int = 0
    gauntlet: GauntletSettings = field(default_factory=GauntletSettings)


def _identities(settings: CheckSettings, scenarios: Sequence[str]) -> CheckReport:
    return check_identities(scenarios, settings.samples, settings.seed)


def _delay(settings: CheckSettings, scenarios: Sequence[str]) -> CheckReport:
    return check_delay(settings.samples, settings.seed)


def _gauntlet(settings: CheckSettings, scenarios: Sequence[str]) -> CheckReport:
    from noninteract_ros.validation.gauntlet.check import check_gauntlet  # Loads the compiler.

    return check_gauntlet(settings.gauntlet)


# Built-in checks by name; they receive the scenarios of the command line.
BUILT_IN: dict[str, Callable[[CheckSettings, Sequence[str]], CheckReport]] = {
    "identities": _identities,
    "delay": _delay,
    "gauntlet": _gauntlet,
}


def run_check(target: str, settings: CheckSettings, others: Sequence[str] = ()) -> CheckReport:
    """Run a built-in check, or check the scenario of that name or file.

    Args:
        target: Name of a built-in check, or name or file of a scenario.
        settings: Options.
        others: Scenarios for a built-in check.

    Raises:
        ScenarioError: The target is neither, or a scenario is invalid.
    """
    if target in BUILT_IN:
        return BUILT_IN[target](settings, others)
    if others:
        raise ScenarioError(
            "scenario", f"{1 + len(others)} of them", "one, or a check's name first"
        )
    path = find_scenario(target)
    return check_scenario(str(path), load_scenario(path), settings)


def check_scenario(name: str, scenario: Scenario, settings: CheckSettings) -> CheckReport:
    """Check singular values, sampled loops and the identities of the law for a scenario."""
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
        *_rate_limit(scenario, stack.names, dynamics, mode.impedance),
        _clearances(scenario, team),
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


def _rate_limit(
    scenario: Scenario, names: Sequence[str], dynamics: TaskDynamics, impedance: Impedance
) -> tuple[Section, ...]:
    """Return up to which speed of its error each subtask's gains fit the torque-rate limit."""
    limit = scenario.safety.torque_rate
    if limit == 0.0:
        return ()
    eye = np.eye(len(impedance.stiffness))
    demands = np.array([rate_demand(dynamics, impedance, rate).max() for rate in eye])
    rows = tuple(
        (name, float(RATE_SHARE * limit / demands[part].max()))
        for name, part in zip(names, dynamics.slices, strict=True)
    )
    title = f"torque rate: {limit:g} N/s or N m/s"
    return (Section(title, ("subtask", "speed that its gains fit [m/s; rad/s]"), rows),)


def _clearances(scenario: Scenario, team: Team) -> Section:
    """Return the nearest pairs of bodies at the start, and the pairs that are left out."""
    scene = scenario.build_scene(team)
    found = scene.evaluate(team.q0, np.zeros(team.n))
    nearest = np.argsort(found.distances)[:NEAREST]
    left_out = [("overlap", scene.pairs.always), ("always apart", scene.pairs.never)]
    rows = (
        *((scene.name(found.pairs[k]), f"{found.distances[k]:.4g}") for k in nearest),
        *(
            (f"{scene.bodies[i].name} - {scene.bodies[j].name}", why)
            for why, pairs in left_out
            for i, j in pairs
        ),
    )
    title = f"bodies: {len(scene.bodies)}, pairs watched: {len(scene.pairs.watched)}"
    return Section(title, ("pair", "distance at the start [m]"), rows)
