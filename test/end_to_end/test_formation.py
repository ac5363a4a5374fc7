# SPDX-License-Identifier: Apache-2.0
"""Stack with thirty robots."""

import numpy as np
from harness import Ros, merged
from repository import ROOT

from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import read_parameters
from noninteract_ros.scenario.rehearsal import rehearse

TICKS = 30


def scenario() -> dict:
    return read_parameters(ROOT / "config" / "formation.yaml")


def test_a_run_of_thirty_robots_equals_the_rehearsal(ros: Ros) -> None:
    """States of all nodes in lockstep equal the rehearsal bit by bit."""
    values = scenario()
    rate = values["rate"]
    stack = ros.stack(merged(values, {"end_time": TICKS / rate})).start()
    stack.monitor.wait_for_status("robot_team", "finished")
    expected = rehearse(Scenario.from_dict(stack.values), TICKS / rate)
    assert expected.q.shape == (TICKS, 60)
    _, q, v, effort = stack.monitor.history(stack.monitor.states)
    np.testing.assert_array_equal(q[:-1], expected.q)
    np.testing.assert_array_equal(v[:-1], expected.v)
    np.testing.assert_array_equal(effort[1:], expected.torque)


def test_the_formation_changes_shape_while_it_moves_in_a_circle() -> None:
    """Distances follow the plan, and the weighted mean follows the circle of the human."""
    built = Scenario.from_dict(scenario())
    history = rehearse(built, built.general.duration)
    error = np.abs(history.x - history.desired)
    assert error[-1].max() < 0.02
    assert np.ptp(history.desired[:, :2], axis=0).min() > 1.0
    assert np.abs(history.desired[-1, 2:] - history.desired[0, 2:]).max() > 0.5
    assert np.linalg.norm(history.q[-1].reshape(30, 2), axis=1).max() < 20.0
