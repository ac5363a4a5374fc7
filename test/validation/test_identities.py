# SPDX-License-Identifier: Apache-2.0
"""`noninteract check identities`: identities of the law on the team of every scenario."""

import json
from pathlib import Path

import numpy as np
import pytest
from planar_arms import PlanarArms, mixed_subtasks
from repository import ROOT

from noninteract_ros import cli
from noninteract_ros.control.law.decoupling import TaskDynamics
from noninteract_ros.control.law.impedance import Impedance
from noninteract_ros.control.safety.singularity import best_regularity, regularity
from noninteract_ros.errors import TeamError
from noninteract_ros.reporting.checks.check_report import CheckReport
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.subtasks.subtask import SubtaskState
from noninteract_ros.team.team import Team, TeamState
from noninteract_ros.validation.check import CheckSettings, run_check
from noninteract_ros.validation.identities import plain_form
from noninteract_ros.validation.identities.identities import IDENTITIES, SKEW, largest_residuals
from noninteract_ros.validation.identities.law_probe import REGULAR, LawProbe

SCENARIOS = sorted(path.stem for path in (ROOT / "config").glob("*.yaml"))


def arms_probe() -> LawProbe:
    team = Team(PlanarArms().robots())
    gains = np.full(team.n, 10.0), np.full(team.n, 5.0), np.full(team.n, np.inf)
    return LawProbe(team, SubtaskStack(team, mixed_subtasks(2)), Impedance(*gains, (None, None)))


def failed(report: CheckReport) -> set[str]:
    return {item.name for item in report.checks if not item.passed}


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_identities_hold_on_every_team(scenario: str) -> None:
    """They hold at random states in the whole joint range, away from singularities."""
    report = run_check("identities", CheckSettings(samples=12, seed=7), [scenario])
    assert report.passed, failed(report)
    measured = {item.name.partition(": ")[2].split(",")[0] for item in report.checks}
    assert measured == {item.name for item in IDENTITIES}


def test_a_slightly_wrong_coriolis_term_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """A relative error of 1e-6 in C~_i fails its identities on arms but not on point masses."""
    right = plain_form.subtask_coriolis

    def wrong(dynamics: TaskDynamics) -> tuple[np.ndarray, ...]:
        return tuple((1.0 + 1e-6) * block for block in right(dynamics))

    monkeypatch.setattr(plain_form, "subtask_coriolis", wrong)
    report = run_check("identities", CheckSettings(samples=5), ["dual_panda", "paper"])
    skew = {f"dM_i/dt - 2 C~_i is skew, {name}" for name in ("cooperative", "relative", "posture")}
    broken = {*skew, "both forms of the torque, noninteracting"}
    assert failed(report) == {f"dual_panda: {name}" for name in broken}
    assert len(report.tables()) == 3  # Legend, residuals and failed checks.


def test_a_slightly_wrong_jacobian_rate_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """A relative error of 1e-6 in the rate of the Jacobian fails."""
    right = SubtaskStack.evaluate

    def wrong(stack: SubtaskStack, state: TeamState) -> SubtaskState:
        task = right(stack, state)
        return SubtaskState(task.x, task.J, (1.0 - 1e-6) * task.J_rate)

    monkeypatch.setattr(SubtaskStack, "evaluate", wrong)
    assert "planar_arms: dJ/dt" in failed(
        run_check("identities", CheckSettings(samples=5), ["planar_arms"])
    )


def test_residuals_have_no_units(monkeypatch: pytest.MonkeyPatch) -> None:
    """A relative error of 1e-6 has the same residual in metres and in millimetres."""
    right, evaluate = plain_form.subtask_coriolis, SubtaskStack.evaluate

    def wrong(dynamics: TaskDynamics) -> tuple[np.ndarray, ...]:
        return tuple((1.0 + 1e-6) * block for block in right(dynamics))

    def in_millimetres(stack: SubtaskStack, state: TeamState) -> SubtaskState:
        task = evaluate(stack, state)
        return SubtaskState(1e3 * task.x, 1e3 * task.J, 1e3 * task.J_rate)

    def skew() -> list[float]:
        largest = largest_residuals(arms_probe(), 5, seed=2)
        return [value for (item, _), value in largest.items() if item is SKEW]

    monkeypatch.setattr(plain_form, "subtask_coriolis", wrong)
    in_metres = skew()
    monkeypatch.setattr(SubtaskStack, "evaluate", in_millimetres)
    np.testing.assert_allclose(skew(), in_metres, rtol=1e-4)
    assert min(in_metres) > SKEW.limit


def test_states_are_regular_complete_and_reproducible() -> None:
    """The requested number of states is regular and equal for equal seeds."""
    probe = arms_probe()
    least = REGULAR * best_regularity(probe.team, probe.stack)
    samples = list(probe.samples(50, seed=1))
    assert len(samples) == 50
    assert probe.rejected > 0
    assert min(regularity(sample.dynamics.S) for sample in samples) >= least
    again = arms_probe().samples(50, seed=1)
    assert all((a.state.q == b.state.q).all() for a, b in zip(samples, again, strict=True))


def test_a_team_without_regular_states_ends_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """If all states are rejected, the search raises an error."""
    monkeypatch.setattr(LawProbe, "_jumps", lambda *_: True)
    with pytest.raises(TeamError, match="singular"):
        next(arms_probe().samples(1, seed=0))


def test_the_command_takes_scenarios(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It measures the given scenarios, prints JSON, and rejects unknown names."""

    def run(*arguments: str) -> int:
        monkeypatch.setattr("sys.argv", ["noninteract", "check", *arguments])
        return cli.main()

    assert run("identities", "paper", "planar_arms", "--states", "2", "--json") == 0
    printed = json.loads(capsys.readouterr().out)
    rows = printed["largest relative residuals"]
    assert [row["scenario"] for row in rows] == ["paper", "planar_arms"]
    assert run("identities", "papper") == 2
    assert run("paper", "planar_arms") == 2


def test_scenarios_without_robot_models_are_skipped(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the extra, only the other scenarios are measured."""
    scenarios = {name: ROOT / "config" / f"{name}.yaml" for name in ("dual_panda", "paper")}
    monkeypatch.setattr(
        "noninteract_ros.validation.identities.identities.known_scenarios", lambda: scenarios
    )
    monkeypatch.setattr(
        "noninteract_ros.team.models.urdf_files.share_folders", lambda: [Path("/none")]
    )
    report = run_check("identities", CheckSettings(samples=1))
    assert report.passed
    assert [text.partition(" ")[0] for text in report.warnings] == ["dual_panda"]
