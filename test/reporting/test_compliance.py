# SPDX-License-Identifier: Apache-2.0
"""Errors of the grasp of two Pandas in fast 6-D motion, under each law and at each rate."""

import io
from pathlib import Path

import numpy as np
import pytest
from rehearsed import scenario_values
from rich.console import Console

from noninteract_ros.reporting.rehearsed.compliance import (
    COMPLIANCE,
    NATURAL,
    PeakErrors,
    compare_laws,
    convergence_order,
    critical_damping,
    laws_metrics,
    measure_law,
)
from noninteract_ros.reporting.report.tables import laws_table
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import find_scenario, load_scenario

DURATION = 2.0  # [s]; the speed is largest at 1.8 s


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    """Two Pandas without an object."""
    return load_scenario(Path(find_scenario("dual_panda_free")))


@pytest.fixture(scope="module")
def at_1_khz(scenario: Scenario) -> PeakErrors:
    """The motion under the noninteracting law at 1 kHz."""
    return measure_law(scenario, "noninteracting", 1000.0, DURATION)


def test_the_grasp_stays_within_1e_5_at_1_khz(at_1_khz):
    """At 0.5 m/s and 1 rad/s no joint limit is active."""
    assert at_1_khz.speed == pytest.approx(0.5, rel=0.01)
    assert at_1_khz.turning == pytest.approx(1.0, rel=0.01)
    assert not at_1_khz.intervened
    assert at_1_khz.position["relative"] < 1e-5
    assert at_1_khz.angle["relative"] < 1e-5


def test_the_remaining_error_is_of_first_order_in_the_tick(scenario, at_1_khz):
    """It halves at twice the rate."""
    fast = measure_law(scenario, "noninteracting", 2000.0, DURATION)
    assert at_1_khz.position["relative"] / fast.position["relative"] == pytest.approx(2.0, abs=0.2)
    assert at_1_khz.angle["relative"] / fast.angle["relative"] == pytest.approx(2.0, abs=0.2)


def test_baselines_are_stable_and_only_compliance_disturbs_the_grasp(scenario, at_1_khz):
    """With the same stiffness `natural` decouples references as well; compliance does not."""
    natural, plain = (measure_law(scenario, law, 1000.0, 2.0) for law in (NATURAL, COMPLIANCE))
    assert max(natural.damping_per_tick, plain.damping_per_tick) < 2.0
    assert not natural.intervened
    assert natural.position["relative"] < 1e-5
    assert 100.0 * at_1_khz.position["relative"] < plain.position["relative"] < 3e-3
    assert 100.0 * at_1_khz.angle["relative"] < plain.angle["relative"] < 3e-3


def test_critical_damping_damps_every_mode_critically():
    """The eigenvalues of the loop are equal pairs -w, -w for any inertia and stiffness."""
    rng = np.random.default_rng(3)
    root = rng.normal(size=(5, 5))
    inertia, stiffness = root @ root.T + 0.1 * np.eye(5), rng.uniform(1.0, 900.0, 5)
    damping = critical_damping(inertia, stiffness)
    np.testing.assert_allclose(damping, damping.T, atol=1e-9)
    inverse = np.linalg.inv(inertia)
    frequencies = np.sqrt(np.linalg.eigvals(inverse * stiffness).real)
    rates = np.linalg.eigvals(inverse @ damping).real
    np.testing.assert_allclose(np.sort(rates), np.sort(2.0 * frequencies), rtol=1e-9)


def test_the_damping_of_the_scenario_is_stable_on_the_natural_inertia(scenario):
    """With closed gates the damping per tick is far below two and no joint limit is active."""
    natural = measure_law(scenario, "natural", 1000.0, DURATION)
    assert natural.damping_per_tick < 0.5
    assert not natural.intervened
    assert natural.position["relative"] < 1e-5


def test_all_laws_are_in_one_table(tmp_path):
    """It lists three rates of the scenario's law, the other laws and the baselines."""
    scenario = Scenario.from_dict(scenario_values(object=None))
    rows = compare_laws(scenario, 0.8)
    assert [row.rate for row in rows[:3]] == [250.0, 500.0, 1000.0]
    names = [row.law for row in rows]
    assert {"noninteracting", "natural", NATURAL, COMPLIANCE} <= set(names)
    assert "paper" not in names
    metrics = laws_metrics(rows, 0.8)
    console = Console(width=160, record=True, file=io.StringIO())
    console.print(laws_table(metrics))
    text = console.export_text()
    for row in rows:
        assert f"{row.position['relative']:.3g}" in text
    assert text.count("energy_gated") == 3
    assert metrics["rows"][1]["max_error_m"]["relative"] == rows[1].position["relative"]


def test_the_order_of_fall_is_that_of_the_errors():
    """Errors that fall to a quarter at twice the rate are of second order."""

    def errors(law: str, rate: float, error: float, damping: float = 0.5) -> PeakErrors:
        return PeakErrors(law, rate, {"a": error}, {"a": 0.0}, 0.0, 0.0, damping, False)

    rows = [errors("x", 500.0, 8e-6), errors("x", 1000.0, 2e-6), errors("y", 1000.0, 1.0)]
    assert convergence_order(rows, "a") == pytest.approx(2.0)
    assert convergence_order(rows[1:], "a") is None
    swinging = errors("x", 250.0, 9.0, damping=2.1)  # Stable from 500 Hz on only.
    assert convergence_order([swinging, *rows], "a") == pytest.approx(2.0)
