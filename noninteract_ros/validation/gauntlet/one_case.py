# SPDX-License-Identifier: Apache-2.0
"""Detailed report of a single case of the gauntlet."""

from typing import Any

import numpy as np

from noninteract_ros.reporting.checks.check_report import CheckReport, Section
from noninteract_ros.validation.gauntlet.cases import Case, make_case
from noninteract_ros.validation.gauntlet.judge import Verdict, judge, trace
from noninteract_ros.validation.gauntlet.settings import GauntletSettings

ROWS = 24  # of the trace
SECONDS = 30.0  # of the trace, at most


def one_case(settings: GauntletSettings, index: int) -> CheckReport:
    """Report robots, gains, environment, outcome of each law and the time course of the last."""
    case = make_case(settings.seed, index, settings.reaction)
    verdicts = judge(case, settings)
    sections = (
        Section("robots and gains", ("quantity", "values"), _team_rows(case)),
        Section("environment", ("element",), tuple((item.text(),) for item in case.elements)),
        Section("outcomes", OUTCOMES, tuple(_outcome(item) for item in verdicts)),
        _course(case, settings, verdicts[-1]),
    )
    target = f"case {index} of the gauntlet with seed {settings.seed}: {case.kind}"
    return CheckReport(target, sections, (), ())


OUTCOMES = ("law", "state", "cause", "time [s]", "growth [1/s]", "mean σ", "σ", "ν", "residual")


def _outcome(item: Verdict) -> tuple[Any, ...]:
    growth = "-" if item.growth is None else f"{item.growth:.4g}"
    numbers = item.sigma_mean, item.sigma, item.nu, item.residual
    return (item.law, item.state, item.cause, item.time, growth, *numbers)


def _team_rows(case: Case) -> tuple[tuple[str, str], ...]:
    team, n = case.team, case.team.n
    rows = [("mass [kg]", team.masses)]
    if case.arms:
        names = "lengths [m], alpha, beta, delta [kg m^2], weights [N m]"
        rows = [(f"arm {i + 1}: {names}", arm) for i, arm in enumerate(team.arms)]
    rows += [
        ("K [N/m]", team.stiffness),
        ("D [N s/m]", team.damping),
        ("q at the start", case.start[0, :n]),
        ("v at the start", case.start[1, :n]),
    ]
    return tuple((name, ", ".join(f"{value:.5g}" for value in row)) for name, row in rows)


def _course(case: Case, settings: GauntletSettings, verdict: Verdict) -> Section:
    """Return account and energies over time."""
    seconds = min(verdict.time, SECONDS)
    stride = max(1, round(seconds * settings.rate / ROWS))
    table = trace(case, verdict.law, settings, ROWS, stride)
    t, sigma, nu, level, reserve, lost, potential, kinetic, environment, residual = table[:, :10].T
    columns = (
        t,
        sigma,
        nu,
        level,
        reserve,
        lost,
        nu * potential + kinetic,
        environment,
        residual,
    )
    names = ("t [s]", "σ", "ν", "tank [J]", "reserve [J]", "L [J]", "V [J]", "env. [J]", "r [J]")
    rows = tuple(tuple(float(value) for value in row) for row in np.array(columns).T)
    return Section(f"time course under {verdict.law}", names, rows)
