# SPDX-License-Identifier: Apache-2.0
"""Teleoperation with delay: unstable without the passivity layer, settled with it."""

import json

import numpy as np
import pytest

from noninteract_ros import cli
from noninteract_ros.reporting.metrics.link_metrics import ROUNDING
from noninteract_ros.validation import delay
from noninteract_ros.validation.check import BUILT_IN, CheckSettings
from noninteract_ros.validation.delay import LinkRun, run, scenario


def test_without_passivity_a_delay_destabilizes_the_loop() -> None:
    """The hand rests without delay; at 50 ms it oscillates and draws energy."""
    still, shaking = (run(scenario("wall", d, "none"), 3.0) for d in (0.0, 0.05))
    assert still.rms_speed < 0.02
    assert still.drawn < 0.01
    assert shaking.rms_speed > 0.2
    assert shaking.drawn > 5.0


@pytest.mark.parametrize("place", ["wall", "carrying"])
def test_with_passivity_the_loop_settles_within_the_energy_bound(place: str) -> None:
    """At 200 ms one way the team reaches its reference."""
    kept = run(scenario(place, 0.2, "tdpa"))
    assert kept.rms_speed < 0.02
    assert kept.excess <= ROUNDING
    assert kept.surprise < 1e-3
    assert kept.offset[-1] < (0.05 if place == "wall" else 0.002)
    force = np.linalg.norm(kept.feedback[-500:].mean(axis=0))  # Average over the tremor.
    assert (force > 3.0) if place == "wall" else (force < 0.1)


@pytest.mark.parametrize(("place", "delay"), [("wall", 0.2), ("carrying", 0.1)])
def test_with_wave_variables_the_loop_settles(place: str, delay: float) -> None:
    """The second passivity layer settles as well."""
    kept = run(scenario(place, delay, "waves"))
    assert kept.rms_speed < 0.04
    assert kept.excess <= ROUNDING
    assert kept.offset[-1] < (0.05 if place == "wall" else 0.02)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """One place and one delay."""
    monkeypatch.setattr(delay, "DELAYS", (0.05,))
    monkeypatch.setattr(delay, "PLACES", {"wall": {}})


@pytest.mark.usefixtures("small")
def test_the_table_has_rows_and_checks(monkeypatch: pytest.MonkeyPatch) -> None:
    """A short `noninteract check delay` has one row and its checks."""
    monkeypatch.setattr(delay, "NETWORKS", {"varying": delay.VARYING})
    report = BUILT_IN["delay"](CheckSettings(samples=1), ())
    (section,) = report.sections
    row = dict(zip(section.columns, section.rows[0], strict=True))
    assert row["loop without"] == "UNSTABLE"
    assert row["loop with"] == "settled"
    assert len(report.checks) == 3 + 1
    assert report.passed


def made_up(net: float, budget: float, speed: float, offset: float) -> LinkRun:
    """Create a run with constant account, hand speed and offset."""
    t = np.linspace(0.0, 4.0, 41)
    hand, feedback = np.full((41, 2), speed), np.zeros((41, 2))
    net_row, budget_row = np.full(41, net), np.full(41, budget)
    return LinkRun(t, hand, net_row, budget_row, feedback, np.full(41, offset), 0.1, 0.001)


GOOD = {"net": -0.1009, "budget": -0.0009, "speed": 0.01, "offset": 0.04}


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("wrong", "claim"),
    [
        ({}, ""),
        ({"net": -0.1011}, "energy drawn beyond the bound, wall, 50 ms, varying"),
        ({"budget": -0.0011}, "energy drawn beyond the bound, wall, 50 ms, varying"),
        ({"speed": 0.04}, "RMS hand speed, wall, 50 ms, varying"),
        ({"offset": 0.06}, "offset of hand and team, wall, 50 ms, varying"),
    ],
)
def test_a_violation_in_one_network_fails_the_check(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    wrong: dict[str, float],
    claim: str,
    seed: int,
) -> None:
    """Exit status and JSON report it for every seed."""

    def found(changed, duration=0.0):
        link = delay.link_of(changed)
        if link.passivity == "none":
            return made_up(-1.0, np.inf, 1.0, 1.0)
        worse = wrong if (link.seed, link.jitter) == (seed, 0.3) else {}
        return made_up(**GOOD | worse)

    monkeypatch.setattr(delay, "run", found)
    monkeypatch.setattr("sys.argv", ["noninteract", "check", "delay", "--json"])
    code = cli.main()
    printed = json.loads(capsys.readouterr().out)
    assert code == (1 if claim else 0)
    assert printed["passed"] is not bool(claim)
    failed = [item["name"] for item in printed["checks"] if not item["passed"]]
    assert failed == ([claim] if claim else [])
    assert [row["network"] for row in printed["delay"]] == ["constant", "varying"]


@pytest.mark.usefixtures("small")
def test_a_loop_that_is_stable_without_passivity_fails_the_check(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The experiment must show the effect of the passivity layer."""
    monkeypatch.setattr(delay, "run", lambda _: made_up(**GOOD))
    report = BUILT_IN["delay"](CheckSettings(), ())
    (failed,) = [check for check in report.checks if not check.passed]
    assert failed.name == "unstable networks without passivity, wall"
