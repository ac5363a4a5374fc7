# SPDX-License-Identifier: Apache-2.0
"""Passivity observer, compared with the simulation's balance and with the account."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rehearsed import record, scenario_values, tamper_account

from noninteract_ros.reporting.metrics.passivity_observer import (
    external_work,
    observe,
    passivity_metrics,
)
from noninteract_ros.reporting.metrics.team_account import team_account
from noninteract_ros.reporting.recording.recorded import Recorded
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import find_scenario, nest, read_parameters
from noninteract_ros.scenario.rehearsal import Rehearsal

DURATION = 1.0


def arms_values(**changes: Any) -> dict[str, Any]:
    """Return upright planar arms in gravity, with friction, references and a push at an elbow."""
    values = nest(dict(read_parameters(find_scenario("planar_arms"))))
    for name in ("left", "right"):
        values[name] |= {"plane": "xz", "friction": [0.3]}
    values["haptic"] |= {"start_time": 0.1}
    values["pushes"] = ["shove"]
    push = {"robot": "left", "frame": "joint_2", "start": 0.3, "duration": 0.2}
    values["shove"] = push | {"force": [15.0, 0.0, -5.0]}
    return values | changes


@pytest.fixture(scope="module")
def arms(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return Recorded(record(tmp_path_factory.mktemp("arms"), arms_values(), DURATION))


def balances(scenario: Scenario, ticks: int) -> np.ndarray:
    """Return works of controls, pushes and losses until each state, shape (ticks, 3) [J]."""
    rehearsal = Rehearsal(scenario)
    rows = []
    for _ in range(ticks):
        energy = rehearsal.simulation.energy()
        rows.append((energy.controls, energy.pushes, energy.lost))
        rehearsal.step()
    return np.array(rows)


def test_received_energy_is_the_work_of_pushes_less_friction(arms: Recorded) -> None:
    """It agrees with the integration of the plant, though sensors measure neither."""
    seen = observe(arms)
    controls, pushes, lost = balances(arms.scenario, len(arms.t)).T
    received = pushes - lost
    assert np.ptp(received) > 0.01
    np.testing.assert_allclose(seen.received, received, atol=1e-6 * np.ptp(received))
    gravity = np.array([arms.team.mechanical_energy(q, np.zeros(4)) for q in arms.q])
    np.testing.assert_allclose(seen.put_in, controls - (gravity - gravity[0]), atol=1e-7)
    assert (seen.gaps, seen.commanded, seen.applied) == (0, len(arms.t) - 1, 0)
    assert seen.altered == 0.0


def test_joint_states_and_commands_suffice(arms: Recorded, tmp_path: Path) -> None:
    """Without other topics the energies are the same."""

    def bare(topic: str, time: float, arrays: list[np.ndarray]) -> list[np.ndarray] | None:
        return arrays if topic.startswith("joint") else None

    seen = observe(Recorded(record(tmp_path, arms_values(), DURATION, bare)))
    expected = observe(arms)
    np.testing.assert_array_equal(seen.received, expected.received)
    np.testing.assert_array_equal(seen.put_in, expected.put_in)
    assert np.isnan(seen.along[-1])  # References are unknown.


def test_gaps_are_excluded_and_counted(arms: Recorded, tmp_path: Path) -> None:
    """Sums contain all energies except those of the gaps."""

    def lossy(topic: str, time: float, arrays: list[np.ndarray]) -> list[np.ndarray] | None:
        lost = 0.4005 < time < 0.4505 or abs(time - 0.7) < 1e-6
        return None if topic == "joint_states" and lost else arrays

    seen = observe(Recorded(record(tmp_path, arms_values(), DURATION, lossy)))
    assert seen.gaps == 2
    assert seen.gap_time == pytest.approx(0.051 + 0.002, abs=1e-9)
    whole = observe(arms).received
    skipped = (whole[451] - whole[400]) + (whole[701] - whole[699])
    assert seen.received[-1] == pytest.approx(whole[-1] - skipped, abs=1e-12)
    assert abs(skipped) > 1e-6


def test_measured_efforts_count_in_wall_time(arms: Recorded, tmp_path: Path) -> None:
    """Commands act late; the efforts of the next states are used."""

    def liar(topic: str, time: float, arrays: list[np.ndarray]) -> list[np.ndarray]:
        return [2.0 * arrays[0]] if topic == "joint_commands" else arrays

    recorded = Recorded(record(tmp_path, arms_values(lockstep=False), DURATION, liar))
    seen = observe(recorded)
    assert (seen.commanded, seen.applied) == (0, len(recorded.t) - 1)
    np.testing.assert_array_equal(seen.received, observe(arms).received)


def test_a_command_that_was_not_applied_shows_in_lockstep(tmp_path: Path) -> None:
    """The difference of command and effort is reported."""

    def liar(topic: str, time: float, arrays: list[np.ndarray]) -> list[np.ndarray]:
        return [arrays[0] + 1.0] if topic == "joint_commands" else arrays

    seen = observe(Recorded(record(tmp_path, arms_values(), 0.2, liar)))
    assert seen.altered == pytest.approx(1.0, abs=1e-9)


def test_constant_inertias_give_the_general_result(tmp_path: Path) -> None:
    """The shortcut for constant inertias agrees with the general computation."""
    quick = Recorded(record(tmp_path, scenario_values(), 0.6))
    slow = Recorded(quick.run)
    slow.__dict__["constant"] = False
    assert quick.constant
    for name in ("kinetic", "put_in", "received", "along"):
        np.testing.assert_allclose(
            getattr(observe(quick), name), getattr(observe(slow), name), atol=1e-12
        )


def test_the_controllers_account_agrees(arms: Recorded) -> None:
    """It agrees with a push at the elbow, friction and moving references."""
    metrics, (check,) = passivity_metrics(arms)
    assert check.passed is True
    received = external_work(observe(arms))[1]
    assert metrics["account"]["disagreement_J"] < 1e-3 * np.abs(received).max()


def test_the_accounts_converge_with_the_tick(tmp_path: Path) -> None:
    """Their difference is due to sampling."""
    apart = []
    for rate in (500.0, 1000.0):
        values = arms_values(rate=rate)
        values["haptic"]["update_rate"] = rate
        run = Recorded(record(tmp_path / f"{rate:g}", values, 0.5))
        apart.append(passivity_metrics(run)[0]["account"]["disagreement_J"])
    assert apart[0] > 1.7 * apart[1]


def test_an_account_with_a_reset_is_compared_by_segments(tmp_path: Path) -> None:
    """Sums that restart at zero pass."""
    run = Recorded(record(tmp_path / "true", arms_values(), DURATION))
    column = team_account(run).received
    base = float(column[120])

    def anew(columns: dict[str, float]) -> None:
        if columns["time"] > 0.4799:
            columns["received"] -= base
            columns["account"] += 1.0

    changed = Recorded(record(tmp_path / "anew", arms_values(), DURATION, tamper_account(anew)))
    assert abs(base) > 1e-3
    _, (check,) = passivity_metrics(changed)
    assert check.passed is True


def test_an_account_without_received_energy_fails(tmp_path: Path) -> None:
    """It hides the work of the push."""

    def nothing(columns: dict[str, float]) -> None:
        columns["received"] = 0.0

    run = Recorded(record(tmp_path, arms_values(), DURATION, tamper_account(nothing)))
    metrics, (check,) = passivity_metrics(run)
    assert check.passed is False
    received = external_work(observe(run))[1]
    assert metrics["account"]["disagreement_J"] == pytest.approx(np.abs(received).max(), rel=0.01)


def test_without_an_account_the_check_does_not_apply(tmp_path: Path) -> None:
    """The energies of the observer are reported."""

    def silent(topic: str, time: float, arrays: list[np.ndarray]) -> list[np.ndarray] | None:
        return None if topic == "energy" else arrays

    run = Recorded(record(tmp_path, arms_values(), 0.4, silent))
    metrics, (check,) = passivity_metrics(run)
    assert check.passed is None
    assert "energy" in check.reason
    assert metrics["received_J"] == pytest.approx(observe(run).received[-1])


def test_jumping_references_agree_to_rounding(tmp_path: Path) -> None:
    """The account agrees in contact over a link with jitter."""
    run = record(tmp_path, read_parameters(find_scenario("delayed_wall")), 1.5)
    metrics, (check,) = passivity_metrics(Recorded(run))
    assert abs(metrics["along_references_J"]) > 0.1
    assert metrics["account"]["disagreement_J"] < 1e-12
    assert check.passed
