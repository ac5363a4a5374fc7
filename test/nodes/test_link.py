# SPDX-License-Identifier: Apache-2.0
"""A device behind a link: the run equals the rehearsal, and the account is published."""

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
    """Return the scenario `delayed_wall` with an early start and changes."""
    loaded = read_parameters(ROOT / "config" / "delayed_wall.yaml")
    early = {"haptic": {"times": [0.0, 0.3, 1.0, 2.0]}, "link": {"delay": 0.03}, "end_time": END}
    return merged(merged(loaded, early), changes)


def compare_with_rehearsal(
    ros: Ros, scenario: dict[str, Any], end: float
) -> dict[float, list[float]]:
    """Check that states and accounts equal the rehearsal bit by bit; return the accounts."""
    accounts: dict[float, list[float]] = {}
    labels: list[list[str]] = []

    def on_account(message: Float64MultiArray) -> None:
        labels.append([item.label for item in message.layout.dim])
        accounts[message.data[0]] = list(message.data[1:])

    ros.probe.create_subscription(Float64MultiArray, "cooperative/link", on_account, 1000)
    stack = ros.stack(scenario)
    ros.wait_for_subscribers(stack.nodes["haptic_emulator"]._account_publisher)
    stack.start()
    stack.monitor.wait_for_status("robot_team", "finished")
    rehearsal = Rehearsal(Scenario.from_dict(stack.values))
    assert rehearsal.link is not None
    expected: dict[float, list[float]] = {}
    _, q, _, _ = stack.monitor.history(stack.monitor.states)
    for tick in range(round(1000 * end)):
        np.testing.assert_array_equal(q[tick], rehearsal.q)
        rehearsal.step()
        if account := rehearsal.link.account:
            expected[tick / 1000] = list(account)
    rate = Scenario.from_dict(stack.values).general.telemetry_rate
    count = round(rate * (end - min(expected)))
    until(lambda: len(accounts) >= count, "the accounts")
    assert labels[0] == ["time", *LinkAccount._fields]
    begin = round(rate * min(expected))
    assert sorted(accounts)[:count] == [tick / rate for tick in range(begin, begin + count)]
    for now in sorted(accounts)[:count]:
        assert accounts[now] == expected[now], now
    return accounts


def test_a_run_over_a_link_equals_the_rehearsal(ros: Ros) -> None:
    """The device touches the wall."""
    accounts = compare_with_rehearsal(ros, values(), END)
    assert max(account[0] for account in accounts.values()) > 0.0


def test_a_link_of_poses_is_passive(ros: Ros) -> None:
    """Two Pandas move and turn a box; the budgets of their link stay non-negative."""
    end = 0.6
    by_time = compare_with_rehearsal(ros, pose_link(delay=0.03) | {"end_time": end}, end)
    accounts = [LinkAccount(*account) for account in by_time.values()]
    for account in accounts:
        assert account.operator_net >= -(0.1 + account.surprise) - 1e-9
        assert account.device_budget >= -account.surprise - 1e-9
    assert accounts[-1].operator_in > 0.01
    assert accounts[-1].team_in > 0.0


def test_the_account_is_in_the_diagnostics(ros: Ros) -> None:
    """Diagnostics have the energies of the link."""
    stack = ros.stack(values(end_time=0.05)).start()
    until(lambda: stack.monitor.value("haptic_emulator", "link, operator_in"), "the account")
