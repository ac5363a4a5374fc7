# SPDX-License-Identifier: Apache-2.0
"""Order of convergence of the storage balances with the control rate."""

from dataclasses import replace

import numpy as np
import pytest

from noninteract_ros.control.tick import Tick
from noninteract_ros.reporting.rehearsed import storage_order
from noninteract_ros.reporting.rehearsed.storage_order import storage_orders, storage_residuals
from noninteract_ros.reporting.report.tables import storage_tables
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import find_scenario, load_scenario
from noninteract_ros.scenario.rehearsal import Rehearsal


@pytest.fixture(scope="module")
def arms() -> Scenario:
    scenario = load_scenario(find_scenario("planar_arms"))
    return replace(scenario, general=replace(scenario.general, rate=250.0))


def test_residuals_are_of_first_order_and_of_second_with_the_hold_work(arms):
    """On two unequal arms with initial velocity, residuals are small against the storage."""
    metrics, checks = storage_orders(arms, 0.4)
    for name in ("cooperative", "relative"):
        found = metrics[name]
        assert found["rate_Hz"] == [250.0, 500.0, 1000.0]
        assert found["order"] == pytest.approx(1.0, abs=0.15)
        assert found["order_unexplained"] == pytest.approx(2.0, abs=0.2)
        assert found["unexplained_J"][-1] < 0.05 * found["missed_J"][-1]
        assert found["missed_J"][-1] < 0.03 * found["peak_J"][-1]
    assert [check.passed for check in checks] == [True] * 4
    (table,) = storage_tables(metrics)
    assert table.row_count == 4


def test_generated_energy_does_not_converge(arms, monkeypatch):
    """A law with an additional constant torque fails."""

    class Cheating(Rehearsal):
        def command(self, tick: Tick) -> np.ndarray:
            return tick.torque + 0.2

    monkeypatch.setattr(storage_order, "Rehearsal", Cheating)
    rows = [storage_residuals(arms, rate, 0.4) for rate in (250.0, 1000.0)]
    for name in ("cooperative", "relative"):
        assert storage_order.convergence_order(rows, name, explained=True) < 0.3


def test_an_unknown_supply_gives_the_reason(arms):
    """Pushes at elbows are not measured at the tools."""
    pushed = load_scenario(find_scenario("carry"))
    metrics, checks = storage_orders(pushed, 0.1)
    assert "not on a tool" in metrics["reason"]
    assert {check.passed for check in checks} == {None}
    assert storage_tables(metrics) == []
