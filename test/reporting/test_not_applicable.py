# SPDX-License-Identifier: Apache-2.0
"""Checks of the law do not apply to runs with joint limits, friction or contact."""

from pathlib import Path
from typing import Any

import pytest
from rehearsed import record, scenario_values

from noninteract_ros.reporting.checks.checks import Check
from noninteract_ros.reporting.recording.recorded import Recorded
from noninteract_ros.reporting.report.metrics import measure

WALL = {"kind": "wall", "point": [0.3, 0.0, 0.0], "normal": [-1.0, 0.0, 0.0]}


def checks(folder: Path, **changes: Any) -> dict[str, Check]:
    run = record(folder, scenario_values(object=None, **changes), 1.2)
    return {check.name: check for check in measure(Recorded(run), other_laws=False).checks}


@pytest.mark.parametrize(
    ("changes", "reason", "names"),
    [
        (
            {"robot_1__effort_limit": [1.0], "robot_2__effort_limit": [1.0]},
            "changed the torque in",
            ["closed_form.cooperative", "closed_form.relative", "noninteraction.human"],
        ),
        (
            {"robot_1__friction": [0.5]},
            "joint friction",
            ["closed_form.relative", "noninteraction.human", "storage_passive.relative"],
        ),
        (
            {"surroundings": ["wall"], "wall": WALL},
            "wall",
            ["closed_form.relative", "noninteraction.human"],
        ),
    ],
    ids=["effort limits", "friction", "wall"],
)
def test_checks_of_the_law_do_not_apply(tmp_path, changes, reason, names):
    """Each has its reason, and no remaining check fails."""
    found = checks(tmp_path, **changes)
    for name in names:
        assert found[name].passed is None
        assert reason in found[name].reason
    assert [check for check in found.values() if check.passed is False] == []


def test_they_apply_with_inactive_limits(tmp_path):
    """The same run with generous limits passes all of them."""
    generous = {"robot_1__effort_limit": [1e4], "robot_2__effort_limit": [1e4]}
    found = checks(tmp_path, **generous)
    for name in ("closed_form.relative", "noninteraction.human", "storage_passive.relative"):
        assert found[name].passed, name
