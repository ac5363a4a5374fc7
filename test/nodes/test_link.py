# SPDX-License-Identifier: Apache-2.0
"""A device behind a link on the stack: the run is the rehearsal, and its account is published."""

from typing import Any

import numpy as np
from harness import Ros, merged, until
from repository import ROOT
from std_msgs.msg import Float64MultiArray

from noninteract_ros.operator.bilateral import LinkAccount
from noninteract_ros.rehearsal import Rehearsal
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario_file import read_parameters

END = 0.4


def values(**changes: Any) -> dict[str, Any]:
    """The delayed wall, led from the start."""
    found = read_parameters(ROOT / "config" / "delayed_wall.yaml")
    early = {"haptic": {"times": [0.0, 0.3, 1.0, 2.0]}, "link": {"delay": 0.03}, "end_time": END}
    return merged(merged(found, early), changes)


def test_over_a_link_too_every_run_is_the_rehearsal_and_the_account_is_told(ros: Ros) -> None:
    """States agree to the bit; the account is labelled, at the telemetry rate, and the same."""
    told: dict[float, list[float]] = {}
    labels: list[list[str]] = []

    def note(message: Float64MultiArray) -> None:
        labels.append([item.label for item in message.layout.dim])
        told[message.data[0]] = list(message.data[1:])

    ros.probe.create_subscription(Float64MultiArray, "cooperative/link", note, 1000)
    stack = ros.stack(values())
    ros.matched(stack.nodes["haptic_emulator"]._account_to)
    stack.begin()
    until(stack.ear.says("robot_team", "finished"), "the end of the run")
    rehearsal = Rehearsal(Scenario.from_dict(stack.values))
    assert rehearsal.link is not None
    expected: dict[float, list[float]] = {}
    _, q, _, _ = stack.ear.history(stack.ear.states)
    for tick in range(round(1000 * END)):
        np.testing.assert_array_equal(q[tick], rehearsal.q)
        rehearsal.step()
        assert rehearsal.link.account is not None
        expected[tick / 1000] = list(rehearsal.link.account)
    until(lambda: len(told) >= 250 * END, "the accounts")
    assert labels[0] == ["time", *LinkAccount._fields]
    assert sorted(told)[:100] == [tick / 250 for tick in range(100)]
    for now in sorted(told)[:100]:
        assert told[now] == expected[now], now
    assert expected[END - 0.001][0] > 0.0


def test_the_account_is_among_the_diagnostics(ros: Ros) -> None:
    """Who looks only there sees the energies too."""
    stack = ros.stack(values(end_time=0.05)).begin()
    until(lambda: stack.ear.value("haptic_emulator", "link, operator_in"), "the account")
