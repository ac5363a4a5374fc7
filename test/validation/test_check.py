# SPDX-License-Identifier: Apache-2.0
"""`noninteract check`: facts, sampled loops and identities of a scenario."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from planar_arms import PlanarArms, mixed_subtasks
from repository import ROOT
from scipy.linalg import expm

from noninteract_ros import cli
from noninteract_ros.control.law import decoupling
from noninteract_ros.control.law.impedance import Impedance
from noninteract_ros.control.stability.sampled_loops import Loop
from noninteract_ros.reporting.checks.check_report import CheckReport
from noninteract_ros.scenario.files import load_scenario, read_parameters
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team
from noninteract_ros.validation import check
from noninteract_ros.validation.check import CheckSettings, run_check
from noninteract_ros.validation.identities import plain_form
from noninteract_ros.validation.identities.identities import identities
from noninteract_ros.validation.identities.law_probe import LawProbe

PAPER = ROOT / "config" / "paper.yaml"
FEW = CheckSettings(samples=3)


def arms_probe() -> LawProbe:
    """Return two unequal planar arms with Coriolis terms."""
    team = Team(PlanarArms().robots())
    gains = np.full(team.n, 10.0), np.full(team.n, 5.0), np.full(team.n, np.inf)
    return LawProbe(team, SubtaskStack(team, mixed_subtasks(2)), Impedance(*gains, (None, None)))


def failed(probe: LawProbe) -> set[str]:
    return {item.name for item in identities(probe, samples=3, seed=1) if not item.passed}


def scenario_file(folder: Path, **changes: object) -> str:
    """Write the paper's scenario with changed values, keys of blocks as `block__key`."""
    values = read_parameters(PAPER)
    for name, value in changes.items():
        block, _, key = name.partition("__")
        if key:
            values[block][key] = value
        else:
            values[block] = value
    file = folder / "changed.yaml"
    file.write_text(yaml.safe_dump({"/**": {"ros__parameters": values}}))
    return str(file)


def row(report: CheckReport, title: str, first: str) -> dict[str, object]:
    return next(item for item in report.as_dict()[title] if first in item.values())


def test_the_papers_team_passes_with_the_papers_numbers() -> None:
    """The paper's inertias of 3 and 0.75 kg and the poles of its closed loops are reported."""
    report = run_check("paper", FEW)
    assert report.passed
    assert not report.warnings
    assert row(report, "subtasks", "cooperative")["inertia M_i [kg]"] == pytest.approx([3.0, 3.0])
    poles = np.roots([0.75, 25.0, 50.0])
    loop = row(report, "loops", "relative")
    assert loop["slowest [1/s]"] == pytest.approx(-poles.max())
    assert loop["fastest [1/s]"] == pytest.approx(-poles.min())
    assert loop["damping ratios"] == pytest.approx([25.0 / 2.0 / np.sqrt(50.0 * 0.75)] * 2)


def test_the_law_holds_on_unequal_arms() -> None:
    """Every identity holds where Coriolis terms and Jacobian rates do not vanish."""
    assert failed(arms_probe()) == set()


@pytest.mark.parametrize(
    ("module", "name", "broken", "found"),
    [
        (
            decoupling.TaskDynamics,
            "divide_by_inertias",
            lambda dynamics, force: force,
            {"both forms of the torque, noninteracting", "both forms of the torque, paper"},
        ),
        (
            decoupling.TaskDynamics,
            "coriolis_force",
            lambda dynamics, e_rate: np.zeros_like(e_rate),
            {"both forms of the torque, noninteracting"},
        ),
        (
            plain_form,
            "subtask_coriolis",
            plain_form.paper_subtask_coriolis,
            {
                "both forms of the torque, noninteracting",
                "dM_i/dt - 2 C~_i is skew, cooperative",
                "dM_i/dt - 2 C~_i is skew, relative",
            },
        ),
        (
            plain_form,
            "decoupling_matrix",
            lambda dynamics: dynamics.MS,
            {
                "J M^-1 Gamma = blkdiag(M_i^-1)",
                "both forms of the torque, noninteracting",
                "both forms of the torque, paper",
            },
        ),
    ],
)
def test_a_broken_law_fails_its_identities(
    monkeypatch: pytest.MonkeyPatch,
    module: object,
    name: str,
    broken: Callable[..., object],
    found: set[str],
) -> None:
    """Each broken part of the law fails exactly the identities that depend on it."""
    monkeypatch.setattr(module, name, broken)
    assert failed(arms_probe()) == found


def test_not_a_number_fails() -> None:
    """A law that returns NaN fails."""
    probe = arms_probe()
    probe.impedance.damping[0] = np.nan
    assert "both forms of the torque, noninteracting" in failed(probe)


def test_a_low_rate_warns_before_it_destabilizes(tmp_path: Path) -> None:
    """At 100 Hz the relative loop of 31 1/s has too few ticks; at 10 Hz it diverges."""
    slow = run_check(scenario_file(tmp_path, rate=100.0, telemetry_rate=50.0), FEW)
    assert slow.passed
    assert len(slow.warnings) == 3
    assert "relative: 100 Hz is low" in slow.warnings[1]
    report = run_check(scenario_file(tmp_path, rate=10.0, telemetry_rate=10.0), FEW)
    assert [item.name for item in report.checks if not item.passed] == [
        "growth per tick, relative",
        "growth per tick, all subtasks at sigma = 0",
    ]


def test_growth_is_that_of_the_stepped_loop() -> None:
    """The growth per tick is the limit of the ratio of norms of the stepped loop."""
    M, D, K, rate = 2.0, 3.0, 40.0, 50.0
    loop = Loop("one", *(np.array([[value]]) for value in (M, D, K)), rate)
    e, speed, norms = 1.0, 0.0, []
    for _ in range(2000):
        a = -(K * e + D * speed) / M
        e, speed = e + speed / rate + 0.5 * a / rate**2, speed + a / rate
        norms.append(np.hypot(e, speed))
    assert (norms[-1] / norms[0]) ** (1 / 1999) == pytest.approx(loop.growth, rel=1e-3)


def dense_growth(team: Team, stack: SubtaskStack, impedance: Impedance, rate: float) -> float:
    """Return the growth under J'(-D e_rate - K e) with zero-order hold, exactly discretized."""
    state = team.state(team.q0, np.zeros(team.n))
    J, n = stack.evaluate(state).J, team.n
    # e = J q: the state is (q, v, torque), and the torque holds.
    flow = np.zeros((3 * n, 3 * n))
    flow[:n, n : 2 * n], flow[n : 2 * n, 2 * n :] = np.eye(n), np.linalg.inv(state.M)
    held = expm(flow / rate)[: 2 * n]
    feedback = J.T @ np.hstack([impedance.stiffness[:, None] * J, impedance.damping[:, None] * J])
    tick = held @ np.vstack([np.eye(2 * n), -feedback])
    return float(np.abs(np.linalg.eigvals(tick)).max())


@pytest.mark.parametrize("damping", [90.0, 900.0])
def test_the_loop_with_closed_gates_is_checked(tmp_path: Path, damping: float) -> None:
    """With sigma = 0 subtasks are coupled and may diverge though each alone is stable."""
    values = read_parameters(ROOT / "config" / "planar_arms.yaml")
    values["relative"]["damping"] = [damping]
    values["rate"] = 500.0
    file = tmp_path / "arms.yaml"
    file.write_text(yaml.safe_dump({"/**": {"ros__parameters": values}}))
    report = run_check(str(file), FEW)
    scenario = load_scenario(file)
    team = scenario.build_team()
    stack = scenario.build_stack(team)
    impedance = scenario.build_controller(team, stack).mode.impedance
    expected = dense_growth(team, stack, impedance, 500.0)
    assert (expected > 1.0) == (damping > 600.0)
    found = row(report, "loops", "all subtasks at sigma = 0")["growth per tick"]
    assert found == pytest.approx(expected, rel=1e-9)
    failing = [item.name for item in report.checks if not item.passed]
    assert failing == (["growth per tick, all subtasks at sigma = 0"] if expected > 1.0 else [])


def test_an_unstable_loop_suggests_a_remedy() -> None:
    """The suggested rate and share of damping are stable; slightly worse values are not."""
    M, D, K = (np.diag(values) for values in ([1.0, 0.02], [10.0, 60.0], [30.0, 30.0]))
    loop = Loop("arms", M, D, K, 1000.0)
    assert loop.growth == pytest.approx(2.0, abs=0.02)
    text = loop.warning()
    assert "an error grows by a factor of" in text
    words = text.split()
    rate, share = float(words[words.index("Hz") - 1]), float(words[words.index("%") - 1]) / 100
    assert Loop("arms", M, D, K, rate + 1.0).stable
    assert Loop("arms", M, share * D, K, 1000.0).stable
    assert not Loop("arms", M, D, K, 0.9 * rate).stable
    assert not Loop("arms", M, 1.25 * share * D, K, 1000.0).stable
    weak = Loop("weak", np.eye(1), 0.01 * np.eye(1), 100.0 * np.eye(1), 1000.0)
    assert "times its damping" in weak.warning()


def test_the_gains_of_two_pandas_are_stable_with_open_and_closed_gates() -> None:
    """Damping designed for M_i was once too large for the natural inertia of a wrist."""
    for name in ("dual_panda", "dual_panda_free"):
        report = run_check(name, FEW)
        assert report.passed
        assert not report.warnings


def test_natural_is_one_loop_of_all_subtasks(tmp_path: Path) -> None:
    """The natural law couples its subtasks, so that its modes involve all of them."""
    report = run_check(scenario_file(tmp_path, law="natural"), FEW)
    assert [item["loop"] for item in report.as_dict()["loops"]] == ["all subtasks"]


def test_a_builtin_check_has_precedence_over_a_scenario(monkeypatch: pytest.MonkeyPatch) -> None:
    """A target that names a built-in check runs that check."""
    expected = CheckReport("law", (), (), ())
    monkeypatch.setitem(check.BUILT_IN, "law", lambda settings, others: expected)
    assert run_check("law", FEW) is expected


def run_command(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    monkeypatch.setattr("sys.argv", ["noninteract", "check", *arguments])
    return cli.main()


def test_the_command_prints_every_check(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The command exits with 0 and its JSON has each check with its limit."""
    assert run_command(monkeypatch, "paper", "--samples", "2", "--json") == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["passed"] is True
    names = [item["name"] for item in printed["checks"]]
    assert "J M^-1 Gamma = blkdiag(M_i^-1)" in names
    assert "dM_i/dt - 2 C~_i is skew, relative" in names
    assert all(item["limit"] is not None for item in printed["checks"])


def test_the_exit_status_reports_failures(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The status is 1 if a check fails, 2 if the scenario does not exist."""
    unstable = scenario_file(tmp_path, rate=10.0, telemetry_rate=10.0)
    assert run_command(monkeypatch, unstable, "--samples", "2") == 1
    assert "growth per tick, relative" in capsys.readouterr().out
    assert run_command(monkeypatch, "papper") == 2
    assert "papper" in capsys.readouterr().err
