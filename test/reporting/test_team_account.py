# SPDX-License-Identifier: Apache-2.0
"""Energy account of the team's external port: metrics, checks and figure."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rehearsed import record, scenario_values, tamper_account

from noninteract_ros.errors import RecordingError
from noninteract_ros.reporting.figures.account_figure import account_figure
from noninteract_ros.reporting.metrics.passivity_observer import external_work, observe
from noninteract_ros.reporting.metrics.team_account import account_metrics, team_account
from noninteract_ros.reporting.recording.recorded import Recorded


def gated(**changes: Any) -> dict[str, Any]:
    return scenario_values(law="energy_gated", **changes)


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return Recorded(record(tmp_path_factory.mktemp("pair"), gated(), 1.2))


def passed(checks: list[Any]) -> dict[str, bool | None]:
    return {check.name.removeprefix("account."): check.passed for check in checks}


def test_gates_stay_open_without_external_force(pair: Recorded) -> None:
    """Metrics agree with the columns of the account."""
    metrics, checks = account_metrics(pair)
    assert passed(checks) == {"residual": True, "sigma": True, "nu": True}
    found = team_account(pair)
    assert metrics["sigma_min"] == 1.0
    assert metrics["sigma_below_1_s"] == 0.0
    assert metrics["tank_min_J"] == found.tank.min()
    assert metrics["tank_max_J"] == found.tank.max()
    assert metrics["residual_max_J"] == found.residual.max()
    assert metrics["lost_J"] == found.lost[-1] > 0.0
    assert metrics["accounts"] == 1


def test_a_closed_gate_fails_and_is_timed(tmp_path: Path) -> None:
    """Sigma is 0.4 for 0.1 s without external force."""

    def closed(columns: dict[str, float]) -> None:
        if 0.2999 < columns["time"] < 0.3999:
            columns["sigma"] = 0.4

    metrics, checks = account_metrics(
        Recorded(record(tmp_path, gated(), 0.6, tamper_account(closed)))
    )
    assert passed(checks) == {"residual": True, "sigma": False, "nu": True}
    assert metrics["sigma_min"] == 0.4
    assert metrics["sigma_below_1_s"] == pytest.approx(0.1, abs=1e-9)


def test_generated_energy_fails(tmp_path: Path) -> None:
    """A residual of 1 uJ fails, and so does NaN."""
    for wrong in (1e-6, np.nan):

        def more(columns: dict[str, float], wrong: float = wrong) -> None:
            columns["residual"] = wrong

        _, checks = account_metrics(Recorded(record(tmp_path, gated(), 0.2, tamper_account(more))))
        assert passed(checks)["residual"] is False


@pytest.mark.parametrize("law", ["natural", "noninteracting"])
def test_laws_without_gates_have_an_account(tmp_path: Path, law: str) -> None:
    """Checks of gates do not apply."""
    metrics, checks = account_metrics(Recorded(record(tmp_path, scenario_values(law=law), 0.3)))
    assert passed(checks) == {"residual": True, "sigma": None, "nu": None}
    assert metrics["sigma_min"] is None
    assert metrics["gated_s"] == 0.0


def test_contact_may_close_a_gate(tmp_path: Path) -> None:
    """Checks of gates do not apply to runs with pushes."""
    push = {"robot": "robot_1", "start": 0.1, "duration": 0.1, "force": [9.0, 0.0, 0.0]}
    run = Recorded(record(tmp_path, gated() | {"pushes": ["shove"], "shove": push}, 0.3))
    _, checks = account_metrics(run)
    assert passed(checks) == {"residual": True, "sigma": None, "nu": None}
    assert "shove" in checks[1].reason


def test_without_an_account_the_reason_is_given(tmp_path: Path) -> None:
    """Recordings without account are readable."""

    def silent(topic: str, time: float, arrays: list[np.ndarray]) -> list[np.ndarray] | None:
        return None if topic == "energy" else arrays

    run = Recorded(record(tmp_path, gated(), 0.2, silent))
    metrics, checks = account_metrics(run)
    assert "energy" in metrics["reason"]
    assert set(passed(checks).values()) == {None}
    with pytest.raises(RecordingError, match="energy"):
        account_figure(run)


def test_the_figure_shows_the_whole_account(pair: Recorded) -> None:
    """Energies, powers, gates and sums are as recorded."""
    figure = account_figure(pair)
    found = team_account(pair)
    expected = [
        ("energy [J]", [found.storage, found.tank, found.reserve]),
        ("power [W]", [found.supplied, found.dissipated, found.demand]),
        ("gate", [found.sigma, found.nu]),
        ("energy [J]", [found.received, found.residual]),
    ]
    assert [axes.get_ylabel() for axes in figure.axes] == [label for label, _ in expected]
    assert figure.axes[-1].get_xlabel() == "time [s]"
    for axes, (_, columns) in zip(figure.axes, expected, strict=True):
        for line, column in zip(axes.lines, columns, strict=False):
            np.testing.assert_array_equal(line.get_xdata(), found.t)
            np.testing.assert_allclose(line.get_ydata(), column, rtol=1e-12, atol=1e-12)
        assert axes.get_legend() is not None
    low, high = figure.axes[2].get_ylim()
    assert low < 0.0 < 1.0 < high
    observed = figure.axes[3].lines[2]
    np.testing.assert_array_equal(observed.get_ydata(), external_work(observe(pair))[1])
