# SPDX-License-Identifier: Apache-2.0
"""The momentum observer finds a push that nobody measures, at first order."""

import numpy as np
import pytest
from planar_arms import UNLIKE, PlanarArms

from noninteract_ros.control.energy.momentum_observer import MomentumObserver
from noninteract_ros.simulation.plant import Plant
from noninteract_ros.simulation.team_simulation import TeamSimulation
from noninteract_ros.team.team import Team

GAIN = 50.0
PUSH = np.array([7.0, -4.0, 0.0, 0.0, 0.0, 0.0])


def observed(rate, duration, push_at=0.1):
    """Time, estimate and true external torque of two moving arms, one of them pushed."""
    team = Team(PlanarArms(UNLIKE).robots(), (0.0, -9.81, 0.0))
    simulation = TeamSimulation(Plant(team), rate)
    simulation.v = np.array([0.5, -0.8, 0.3, 0.6])
    observer = MomentumObserver(team, GAIN)
    rows = []
    torque = np.zeros(team.n)
    for k in range(round(duration * rate)):
        pushed = k >= push_at * rate
        found = observer.step(1.0 / rate if k else 0.0, simulation.q, simulation.v, torque)
        wrenches = np.zeros((2, 6))
        wrenches[0] = PUSH if pushed else 0.0
        state = team.state(simulation.q, simulation.v)
        rows.append((k / rate, found.copy(), team.external_torque(state, wrenches)))
        torque = team.gravity(simulation.q) + np.array([0.4, -0.2, 0.5, 0.1])
        if pushed:
            simulation.push("arm_1", PUSH, False, 1.5 / rate)
        simulation.step(torque)
    t, estimate, true = (np.array(column) for column in zip(*rows, strict=True))
    return t, estimate, true


def test_nothing_is_seen_where_nothing_acts():
    """In free motion under known torques the estimate is what the integration leaves."""
    t, estimate, _ = observed(1000.0, 0.1)
    assert np.abs(estimate[t < 0.1]).max() < 1e-3


def lagged(true, rate):
    """The true torque seen through the lag 1 / (1 + s / K), step by step."""
    seen = np.zeros_like(true)
    for k in range(1, len(true)):
        seen[k] = true[k - 1] + (seen[k - 1] - true[k - 1]) * np.exp(-GAIN / rate)
    return seen


def test_a_known_push_is_found_at_first_order():
    """The estimate goes to a push as 1 - exp(-K t), and follows it as the arm turns."""
    t, estimate, true = observed(1000.0, 0.4)
    pushed = np.searchsorted(t, 0.1)
    for moment in (0.01, 0.02):
        k = np.searchsorted(t, 0.1 + moment)
        share = estimate[k, 0] / true[pushed, 0]
        assert share == pytest.approx(1.0 - np.exp(-GAIN * moment), abs=0.05)
    largest = np.abs(true).max()
    np.testing.assert_allclose(estimate, lagged(true, 1000.0), atol=0.02 * largest)
    np.testing.assert_allclose(estimate[-1, 2:], 0.0, atol=1e-3 * largest)


def test_its_error_falls_with_the_rate():
    """Beyond the lag there is only what sampling makes: half the tick, half of it."""
    errors = []
    for rate in (250.0, 500.0, 1000.0):
        _, estimate, true = observed(rate, 0.3, push_at=0.0)
        errors.append(np.abs(estimate - lagged(true, rate)).max())
    assert errors[1] < 0.6 * errors[0]
    assert errors[2] < 0.6 * errors[1]
