# SPDX-License-Identifier: Apache-2.0
"""Recorded subtasks agree with their closed-form error dynamics."""

from pathlib import Path

import numpy as np
import pytest
from rehearsed import record, reference, scenario_values
from scipy.integrate import solve_ivp

from noninteract_ros.nodes.messages.messages import SubtaskCodec
from noninteract_ros.reporting.metrics.closed_form import (
    DesiredPath,
    NotApplicableError,
    closed_form,
    closed_form_check,
)
from noninteract_ros.reporting.metrics.influences import influences
from noninteract_ros.reporting.recording.recorded import Recorded, RecordedMotion


def deviation(folder: Path, subtask: str, **changes: object) -> float:
    recorded = Recorded(record(folder, scenario_values(**changes), 1.5))
    found = closed_form(recorded, subtask, influences(recorded))
    check = closed_form_check(recorded, subtask, found)
    assert check.passed
    return float(np.abs(found.deviation).max())


def test_the_deviation_from_the_papers_equations_halves_with_the_tick(tmp_path: Path) -> None:
    """The effect of the zero-order hold is of first order in both subtasks."""
    for subtask in ("cooperative", "relative"):
        coarse, fine = (
            deviation(tmp_path, subtask, rate=rate, haptic__update_rate=rate)
            for rate in (500.0, 1000.0)
        )
        assert coarse > 1e-4
        assert fine == pytest.approx(coarse / 2.0, rel=0.05)


def test_it_is_the_papers_scalar_equation(tmp_path: Path) -> None:
    """The prediction solves 0.75 e'' + 25 e' + 50 e = -20 e."""
    recorded = Recorded(record(tmp_path, scenario_values(), 1.0))
    found = closed_form(recorded, "relative", [])
    np.testing.assert_allclose(found.inertia, 0.75 * np.eye(2), rtol=1e-12)
    e = np.array([0.6 - 1.0, 0.0])
    by_hand = solve_ivp(
        lambda t, y: [y[1], -(25.0 * y[1] + 70.0 * y[0]) / 0.75],
        (0.0, found.t[-1]),
        e,
        t_eval=found.t,
        rtol=1e-11,
        atol=1e-13,
    )
    rows = np.searchsorted(recorded.t, found.t)
    predicted = recorded.values[0][rows, 2] - found.deviation[:, 0]
    np.testing.assert_allclose(predicted, 1.0 + by_hand.y[0], atol=1e-8)


@pytest.mark.parametrize(
    "changes",
    [
        {"object__sign": "paper"},
        {"object": None},
        {"relative__inertia": [1.5]},
        {"relative__potential": "saturating", "relative__max_force": [8.0]},
        {"relative__takeover": "shaped"},
        {
            "pushes": ["shove"],
            "shove": {"robot": "robot_1", "start": 0.3, "duration": 0.2, "force": [4.0, 1.0, 0.0]},
        },
        {
            "planner__formations": ["pair", "wide"],
            "planner__wide": {"time": 0.4, "duration": 0.8, "value": [1.5, 0.5]},
        },
    ],
    ids=lambda changes: next(iter(changes)),
)
def test_every_scenario_of_point_masses_has_a_closed_form(tmp_path: Path, changes: dict) -> None:
    """Objects, inertias, potentials, takeovers, pushes and motions are part of the equation."""
    assert 0.0 < deviation(tmp_path, "relative", **changes) < 2e-3


def test_other_dynamics_fail_the_check(tmp_path: Path) -> None:
    """Joint states of a run with 20 % more stiffness than the scenario fail the check."""
    stiff = record(tmp_path, scenario_values(relative__stiffness=[60.0]), 1.0)
    states = iter(stiff.joints("joint_states").position)

    def swap(topic: str, time: float, arrays: list[np.ndarray]) -> list[np.ndarray]:
        return [next(states), *arrays[1:]] if topic == "joint_states" else arrays

    recorded = Recorded(record(tmp_path, scenario_values(), 1.0, swap))
    check = closed_form_check(recorded, "relative", closed_form(recorded, "relative", []))
    assert check.passed is False


def test_an_inapplicable_closed_form_gives_the_reason(tmp_path: Path) -> None:
    """Other laws, external inputs and subtasks without references do not pass."""
    codec = SubtaskCodec("relative", ("robot_1-robot_2",), ("x", "y"))

    def foreign(writer) -> None:
        data = reference(codec, 0.1234, np.ones(2))
        kind = "trajectory_msgs/msg/MultiDOFJointTrajectory"
        writer.add("/team/relative/autonomy/reference", kind, 0, 0, data)

    cases = [
        (scenario_values(law="natural"), None, "natural does not decouple"),
        (scenario_values(), foreign, "references with unexpected stamps"),
        (scenario_values(planner=None), None, "no two consecutive references"),
    ]
    for values, extra, reason in cases:
        recorded = Recorded(record(tmp_path, values, 0.3, extra=extra))
        with pytest.raises(NotApplicableError, match=reason) as caught:
            closed_form(recorded, "relative", influences(recorded))
        check = closed_form_check(recorded, "relative", str(caught.value))
        assert check.passed is None
        assert check.value is None


def test_stamps_are_not_checked_in_wall_time(tmp_path: Path) -> None:
    """Stamps count from 1970, so that references at any time are allowed."""
    codec = SubtaskCodec("relative", ("robot_1-robot_2",), ("x", "y"))

    def late(writer) -> None:
        kind = "trajectory_msgs/msg/MultiDOFJointTrajectory"
        data = reference(codec, 1.79e9, np.ones(2))
        writer.add("/team/relative/autonomy/reference", kind, 0, 0, data)

    recorded = Recorded(record(tmp_path, scenario_values(lockstep=False), 0.1, extra=late))
    assert influences(recorded) == []


def test_the_quintic_fits_its_points() -> None:
    """Position, velocity and acceleration fit at the points; a quintic fits everywhere."""
    t = np.array([0.0, 0.3, 0.35, 1.0])
    p = np.polynomial.Polynomial([1.0, -2.0, 3.0, 0.5, -1.0, 2.0])
    derivatives = [p, p.deriv(), p.deriv(2)]
    path = DesiredPath(RecordedMotion(t, *(d(t)[:, None] for d in derivatives)))
    for instants in (t, np.linspace(0.0, 1.0, 23)):
        for found, exact in zip(path(instants), derivatives, strict=True):
            np.testing.assert_allclose(found[:, 0], exact(instants), atol=1e-10)
