# SPDX-License-Identifier: Apache-2.0
"""`noninteract check gauntlet`: stability of the laws with random passive environments."""

from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track

from noninteract_ros.reporting.checks.check_report import CheckReport, Section
from noninteract_ros.reporting.checks.checks import Check, at_most, not_applicable
from noninteract_ros.validation.gauntlet.cases import make_case
from noninteract_ros.validation.gauntlet.judge import STATES, Verdict, judge
from noninteract_ros.validation.gauntlet.one_case import one_case
from noninteract_ros.validation.gauntlet.settings import GUARANTEED, GauntletSettings

ROUNDING = 1e-9  # of a residual, relative to the initial energy of a case
COUNTS = ("law", "cases", *STATES[1:], "nu < 0.5")
JUDGED = ("law", "by eigenvalue", "by simulation", "both agree", "undecided", "disagree")
ENERGY = ("law", "residual", "|r + L|", "plant imbalance", "max sampling", "mean sampling")
GATES = (
    "law",
    "mean sigma",
    "min sigma",
    "share with sigma = 1",
    "cases with sigma < 1",
    "min level [J]",
)


def check_gauntlet(settings: GauntletSettings) -> CheckReport:
    """Run all cases under all laws and count outcomes, or report a single case in detail."""
    if settings.only is not None:
        return one_case(settings, settings.only)
    return counted(settings, run_cases(settings))


def counted(settings: GauntletSettings, verdicts: Sequence[Verdict]) -> CheckReport:
    """Return counts of all verdicts by law, and checks of the passive laws."""
    by_law = {law: [item for item in verdicts if item.law == law] for law in settings.laws}
    named = [item for item in verdicts if not item.settled]
    checks = [check for law, own in by_law.items() for check in _claims(law, own, settings)]
    tables = (
        ("outcomes", COUNTS, _counts),
        ("stability verdicts", JUDGED, _judged),
        ("energy relative to the initial one", ENERGY, _energy),
        ("gates", GATES, _gates),
    )
    sections = [
        Section(title, columns, tuple(row(law, own) for law, own in by_law.items()))
        for title, columns, row in tables
    ]
    if named:
        sections.append(_not_at_rest(named))
    if any(item.law in GUARANTEED for item in named):
        sections.append(_in_detail(settings, named))
    target = (
        f"gauntlet of {settings.cases} cases, seed {settings.seed}, {settings.rate:g} Hz, "
        f"delay {settings.delay} ticks, {100 * settings.drop:g} % of the states lost"
    )
    return CheckReport(target, tuple(sections), tuple(checks), (), brief=True)


def run_cases(settings: GauntletSettings) -> list[Verdict]:
    """Return verdicts by case and law; compiled code runs in parallel threads."""

    def one(index: int) -> list[Verdict]:
        return judge(make_case(settings.seed, index, settings.reaction), settings)

    verdicts = one(0)  # Compile before starting the threads.
    indices = range(1, settings.cases)
    shown = Console(stderr=True)
    with ThreadPoolExecutor(settings.workers) as pool:
        found = pool.map(one, indices)
        for own in track(found, "cases", len(indices), console=shown, transient=True):
            verdicts += own
    return verdicts


def _counts(law: str, own: Sequence[Verdict]) -> tuple[Any, ...]:
    ends = Counter(STATES[1] if item.unstable else item.state for item in own)
    return (
        law,
        len(own),
        *(ends[state] for state in STATES[1:]),
        sum(item.yields for item in own),
    )


def _judged(law: str, own: Sequence[Verdict]) -> tuple[object, ...]:
    linear = [item for item in own if item.growth is not None]
    return (
        law,
        0 if law == "energy_gated" else len(linear),
        len(own),
        sum(item.agreed is True for item in linear),
        sum(item.agreed is None for item in linear),
        sum(item.agreed is False for item in linear),
    )


def _energy(law: str, own: Sequence[Verdict]) -> tuple[object, ...]:
    largest = [
        max(getattr(item, name) for item in own)
        for name in ("residual", "mismatch", "imbalance", "sampling")
    ]
    mean = float(np.mean([item.sampling for item in own if item.state != STATES[1]] or [0.0]))
    return (law, *largest, mean)


def _gates(law: str, own: Sequence[Verdict]) -> tuple[object, ...]:
    return (
        law,
        float(np.mean([item.sigma_mean for item in own])),
        min(item.sigma_least for item in own),
        float(np.mean([item.sigma_full for item in own])),
        sum(item.sigma_least < 1.0 for item in own),
        min(item.level_least for item in own),
    )


def _claims(law: str, own: Sequence[Verdict], settings: GauntletSettings) -> list[Check]:
    disagreed = sum(item.agreed is False for item in own)
    checks = [at_most(f"disagreeing verdicts, {law}", disagreed, 0, "cases")]
    if law not in GUARANTEED:
        return checks
    counts = dict(zip(COUNTS, _counts(law, own), strict=True))
    for name in STATES[1:]:
        checks.append(at_most(f"{name}, {law}", counts[name], 0, "cases"))
    name, largest = f"residual, {law}", max(item.residual for item in own)
    if settings.delay and settings.drop:
        reason = "with lost states, changes of the torque are accounted to third order only"
        return [*checks, not_applicable(name, ROUNDING, "relative", reason)]
    return [*checks, at_most(name, largest, ROUNDING, "relative")]


def _not_at_rest(named: Sequence[Verdict]) -> Section:
    """Return counts and numbers of cases not at rest, by law and cause."""
    groups: dict[tuple[str, str], list[str]] = {}
    for item in named:
        groups.setdefault((item.law, item.cause), []).append(str(item.index))
    rows = tuple((*key, len(cases), tuple(cases)) for key, cases in groups.items())
    return Section("not at rest, by cause", ("law", "cause", "count", "cases"), rows)


def _in_detail(settings: GauntletSettings, named: Sequence[Verdict]) -> Section:
    """Return details of the cases not at rest under passive laws."""
    rows = []
    for item in named:
        if item.law in GUARANTEED:
            case = make_case(settings.seed, item.index, settings.reaction)
            rate = "-" if item.growth is None else f"{item.growth:.3g}"
            numbers = item.time, item.speed, item.sigma, item.nu
            rows.append((str(item.index), item.law, case.kind, item.cause, rate, *numbers))
    columns = ("case", "law", "kind", "cause", "growth rate [1/s]", "time [s]", "speed", "σ", "ν")
    return Section("passive laws not at rest", columns, tuple(rows))
