# SPDX-License-Identifier: Apache-2.0
"""Energy account of a link: figure and checks."""

from pathlib import Path

import numpy as np
import pytest
from rehearsed import record, scenario_values

from noninteract_ros.nodes.messages.messages import EnergyCodec
from noninteract_ros.reporting.figures.figures import draw
from noninteract_ros.reporting.figures.link_figure import link_figure
from noninteract_ros.reporting.metrics.link_metrics import link_account, link_metrics, operator_net
from noninteract_ros.reporting.recording.recorded import Recorded
from noninteract_ros.reporting.recording.writer import RunWriter
from noninteract_ros.sources.link.bilateral import LinkAccount

KIND = "std_msgs/msg/Float64MultiArray"


def recorded(
    folder: Path, budget: float, drawn: float = 0.5, debt_free: float = 0.309
) -> Recorded:
    """Record a run with ten link accounts, a surprise of 0.01 J and falling device budgets."""
    values = scenario_values(haptic__hand_mass=0.5)
    values["link"] = {"delay": 0.1, "reserve": 0.25}
    codec = EnergyCodec(("time", *LinkAccount._fields))

    def accounts(writer: RunWriter) -> None:
        for n in range(10):
            energies = [2.0 * n, drawn * n, 1.5 * n, 0.1 * n]
            account = np.array([0.1 * n, *energies, debt_free - 0.001 * n, budget, 0.01, 4.0])
            stamp = 10**8 * n
            writer.add("/team/cooperative/link", KIND, stamp, stamp, codec.encode(account))

    return Recorded(record(folder, values, 0.2, extra=accounts))


@pytest.mark.parametrize("budget", [0.7, np.inf])
def test_the_figure_shows_ports_balance_and_budgets(tmp_path: Path, budget: float) -> None:
    """Curves are as published; infinite budgets are not drawn."""
    run = recorded(tmp_path, budget)
    account = link_account(run)
    assert account is not None
    np.testing.assert_allclose(operator_net(account), 1.5 * np.arange(10))
    figure = link_figure(run, account)
    ports, balance, budgets = figure.axes
    curves = {str(line.get_label()): line.get_ydata() for line in ports.lines}
    np.testing.assert_allclose(curves["hand: in"], 2.0 * np.arange(10))
    np.testing.assert_allclose(curves["team: out"], 0.1 * np.arange(10))
    bound = {str(line.get_label()): line.get_ydata() for line in balance.lines}["bound"]
    np.testing.assert_allclose(bound, -0.26)
    assert np.isfinite(budgets.lines[1].get_ydata()).all() == np.isfinite(budget)


@pytest.mark.parametrize(("drawn", "kept"), [(0.5, True), (2.0288, True), (2.0290, False)])
def test_energy_drawn_beyond_the_bound_fails(tmp_path: Path, drawn: float, kept: bool) -> None:
    """The smallest balance is 9 (2 - drawn) J; reserve and surprise are 0.26 J."""
    metrics, (check, debt) = link_metrics(recorded(tmp_path, 0.5, drawn))
    assert check.passed is kept
    assert debt.passed
    assert metrics["link"]["least_operator_net_J"] == pytest.approx(min(0.0, 9 * (2.0 - drawn)))
    assert metrics["link"]["lost"] == 4
    assert metrics["link"]["least_device_budget_J"] == pytest.approx(0.3)


@pytest.mark.parametrize(("first", "kept"), [(-0.0009, True), (-0.0011, False)])
def test_a_device_budget_below_the_overdraft_of_single_ticks_fails(
    tmp_path: Path, first: float, kept: bool
) -> None:
    """The budget falls by 9 mJ from the first account on; the overdraft is 10 mJ."""
    _, (_, debt) = link_metrics(recorded(tmp_path, 0.5, debt_free=first))
    assert debt.passed is kept


def test_the_figure_is_drawn_only_for_runs_with_a_link(tmp_path: Path) -> None:
    """`link.png` is among the files only with a link."""
    for name, run in (
        ("with", recorded(tmp_path, 0.5)),
        ("without", Recorded(record(tmp_path, scenario_values(), 0.2))),
    ):
        folder = tmp_path / name
        folder.mkdir()
        files, _ = draw(run, folder)
        assert ("link.png" in {file.name for file in files}) == (name == "with")
