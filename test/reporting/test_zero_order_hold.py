# SPDX-License-Identifier: Apache-2.0
"""Effect of the zero-order hold of the torque on unequal planar arms."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rehearsed import record

from noninteract_ros.control.law.impedance import Impedance
from noninteract_ros.reporting.checks.checks import Check
from noninteract_ros.reporting.metrics.storage_functions import energy_metrics
from noninteract_ros.reporting.metrics.zero_order_hold import deflection, recorded_hold_force
from noninteract_ros.reporting.recording.recorded import Recorded
from noninteract_ros.reporting.report.metrics import measure
from noninteract_ros.scenario.files import find_scenario, read_parameters

DURATION = 1.2


def arms(folder: Path, rate: float = 1000.0, **changes: Any) -> Recorded:
    """Record a short run of planar_arms, led from the start."""
    values = read_parameters(find_scenario("planar_arms")) | {"rate": rate} | changes
    for arm in ("left", "right"):
        values[arm] |= {"velocity_limit": [30.0], "effort_limit": [1000.0]}
    values["haptic"] |= {"start_time": 0.0, "ramp_time": 0.5, "update_rate": rate}
    return Recorded(record(folder, values, DURATION))


def checks_of(recorded: Recorded) -> dict[str, Check]:
    """Return the checks of a run by name, without other laws."""
    return {check.name: check for check in measure(recorded, other_laws=False).checks}


def test_moving_arms_pass_every_check(tmp_path):
    """Coupling and storage growth stay within the effect of the zero-order hold."""
    checks = checks_of(arms(tmp_path))
    assert [check.name for check in checks.values() if check.passed is False] == []
    for name in ("noninteraction.human", "storage_growth.relative", "storage_rate.cooperative"):
        assert checks[name].passed


def test_the_effect_of_the_hold_is_of_first_order(tmp_path):
    """Coupling and its limit halve with the tick."""
    coarse, fine = (
        checks_of(arms(tmp_path / str(rate), rate))["noninteraction.human"]
        for rate in (500.0, 1000.0)
    )
    assert coarse.value is not None
    assert fine.value == pytest.approx(0.5 * coarse.value, rel=0.1)
    assert fine.limit == pytest.approx(0.5 * coarse.limit, rel=0.1)
    assert fine.limit < 5.0 * fine.value


def test_the_energy_balance_closes_with_the_hold_work(tmp_path):
    """The residual of (33) is forty times smaller than the hold work."""
    recorded = arms(tmp_path)
    with_work, _ = energy_metrics(recorded, "cooperative", recorded_hold_force(recorded))
    assert with_work["rate_mismatch_J"] < with_work["hold_work_J"] / 40.0


def test_a_law_that_generates_energy_fails(tmp_path):
    """With the paper's C_s,ii storage grows without supply."""
    loose = {"stiffness": [40.0], "damping": [0.3], "takeover": "direct", "authority": "human"}
    changes = {
        "cooperative": loose | {"kind": "cooperative_position"},
        "relative": loose | {"kind": "relative_position", "authority": "autonomy"},
        "haptic": {"motion": "still", "centre": [0.1, 0.65]},
        "planner": {"formations": ["wide"], "wide": {"value": [-0.6, 0.15]}},
    }
    failed = {
        law: not checks_of(arms(tmp_path / law, law=law, **changes))[
            "storage_growth.cooperative"
        ].passed
        for law in ("paper", "noninteracting")
    }
    assert failed == {"paper": True, "noninteracting": False}


def test_the_deflection_of_a_damper_grows_with_the_duration():
    """Springs and short durations bound the deflection."""
    gains = Impedance(np.array([10.0, 0.0]), np.array([5.0, 5.0]), np.full(2, np.inf), (None,))
    force = np.array([[1.0, 1.0], [-2.0, 0.5]])
    assert deflection(gains, force, 100.0) == pytest.approx([0.4, 40.0])
    assert deflection(gains, np.zeros((1, 2)), 1.0) == pytest.approx([0.0, 0.0])
