# SPDX-License-Identifier: Apache-2.0
"""Storage against supply at several rates: what is missed falls as holding the torque says."""

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


def test_residuals_fall_in_first_order_and_in_second_once_holding_is_counted(arms):
    """On two unlike arms that somebody struck, with energies a thousand times what is missed."""
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


def test_energy_from_nowhere_does_not_fall_with_the_tick(arms, monkeypatch):
    """A law that pushes with a constant torque of its own is found out."""

    class Cheating(Rehearsal):
        def command(self, tick: Tick) -> np.ndarray:
            return tick.torque + 0.2

    monkeypatch.setattr(storage_order, "Rehearsal", Cheating)
    rows = [storage_residuals(arms, rate, 0.4) for rate in (250.0, 1000.0)]
    for name in ("cooperative", "relative"):
        assert storage_order.convergence_order(rows, name, explained=True) < 0.3


def test_where_nobody_knows_the_supply_it_says_so(arms):
    """People who push elbows are felt by no tool."""
    pushed = load_scenario(find_scenario("carry"))
    metrics, checks = storage_orders(pushed, 0.1)
    assert "not on a tool" in metrics["reason"]
    assert {check.passed for check in checks} == {None}
    assert storage_tables(metrics) == []
