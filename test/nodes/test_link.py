# SPDX-License-Identifier: Apache-2.0
"""A device behind a link on the stack: the run is the rehearsal, and its account is told."""

from typing import Any

import numpy as np
from harness import Ros, merged
from pose_link import pose_link
from repository import ROOT
from std_msgs.msg import Float64MultiArray
from waiting import until

from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import read_parameters
from noninteract_ros.scenario.rehearsal import Rehearsal
from noninteract_ros.sources.link.bilateral import LinkAccount

END = 0.4


def values(**changes: Any) -> dict[str, Any]:
    """The delayed wall, led from the start."""
    found = read_parameters(ROOT / "config" / "delayed_wall.yaml")
    early = {"haptic": {"times": [0.0, 0.3, 1.0, 2.0]}, "link": {"delay": 0.03}, "end_time": END}
    return merged(merged(found, early), changes)


def runs_as_rehearsed(ros: Ros, found: dict[str, Any], end: float) -> dict[float, list[float]]:
    """States agree to the bit, accounts are labelled, at the telemetry rate, and the same."""
    told: dict[float, list[float]] = {}
    labels: list[list[str]] = []

    def note(message: Float64MultiArray) -> None:
        labels.append([item.label for item in message.layout.dim])
        told[message.data[0]] = list(message.data[1:])

    ros.probe.create_subscription(Float64MultiArray, "cooperative/link", note, 1000)
    stack = ros.stack(found)
    ros.matched(stack.nodes["haptic_emulator"]._account_publisher)
    stack.begin()
    until(stack.ear.says("robot_team", "finished"), "the end of the run")
    rehearsal = Rehearsal(Scenario.from_dict(stack.values))
    assert rehearsal.link is not None
    expected: dict[float, list[float]] = {}
    _, q, _, _ = stack.ear.history(stack.ear.states)
    for tick in range(round(1000 * end)):
        np.testing.assert_array_equal(q[tick], rehearsal.q)
        rehearsal.step()
        if account := rehearsal.link.account:
            expected[tick / 1000] = list(account)
    rate = Scenario.from_dict(stack.values).general.telemetry_rate
    count = round(rate * (end - min(expected)))
    until(lambda: len(told) >= count, "the accounts")
    assert labels[0] == ["time", *LinkAccount._fields]
    begin = round(rate * min(expected))
    assert sorted(told)[:count] == [tick / rate for tick in range(begin, begin + count)]
    for now in sorted(told)[:count]:
        assert told[now] == expected[now], now
    return told


def test_over_a_link_too_every_run_is_the_rehearsal_and_the_account_is_told(ros: Ros) -> None:
    """At the wall."""
    told = runs_as_rehearsed(ros, values(), END)
    assert max(account[0] for account in told.values()) > 0.0


def test_arms_that_are_led_in_six_degrees_of_freedom_give_nothing_away(ros: Ros) -> None:
    """Two Pandas with a box, over DDS in lockstep: the account of a run that moves and turns."""
    end = 0.6
    told = runs_as_rehearsed(ros, pose_link(delay=0.03) | {"end_time": end}, end)
    accounts = [LinkAccount(*account) for account in told.values()]
    for account in accounts:
        assert account.operator_net >= -(0.1 + account.surprise) - 1e-9
        assert account.device_budget >= -account.surprise - 1e-9
    assert accounts[-1].operator_in > 0.01
    assert accounts[-1].team_in > 0.0


def test_the_account_is_among_the_diagnostics(ros: Ros) -> None:
    """Who looks only there sees the energies too."""
    stack = ros.stack(values(end_time=0.05)).begin()
    until(lambda: stack.ear.value("haptic_emulator", "link, operator_in"), "the account")
