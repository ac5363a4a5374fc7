# SPDX-License-Identifier: Apache-2.0
"""The team's energy account over DDS: what it tells at the door, and how it is refilled."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml
from harness import Ros, merged, paper
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message
from repository import ROOT
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from waiting import until

from noninteract_ros.nodes.controller.telemetry import ACCOUNT_LABELS, imbalance_text


def door(**changes: Any) -> dict[str, Any]:
    """The scenario of two unlike robots at one door."""
    text = Path(ROOT / "config" / "door.yaml").read_text(encoding="utf-8")
    return merged(yaml.safe_load(text)["/**"]["ros__parameters"], changes)


class Accounts:
    """Listens to the team's account."""

    def __init__(self, ros: Ros) -> None:
        self.rows: list[dict[str, float]] = []
        ros.probe.create_subscription(Float64MultiArray, "energy", self._take, 10_000, raw=True)

    def _take(self, data: bytes) -> None:
        message = deserialize_message(data, Float64MultiArray)
        labels = [dim.label for dim in message.layout.dim]
        assert tuple(labels) == ACCOUNT_LABELS
        self.rows.append(dict(zip(labels, message.data, strict=True)))


def test_the_door_s_account_is_told_tick_by_tick(ros: Ros) -> None:
    """At the door sigma closes, diagnostics warn, the sums balance, and a refill is told."""
    accounts = Accounts(ros)
    stack = ros.stack(door()).begin()
    stack.run_until(3.0)
    until(stack.ear.says("controller", "energy tank was low"), "the warning")
    assert stack.ear.status["controller"][0] == 1
    rows = list(accounts.rows)
    assert rows[0]["sigma"] == 1.0
    assert rows[-1]["sigma"] < 0.9
    for row in rows:
        assert abs(row["residual"] + row["lost"]) < 1e-9
        assert row["residual"] < 1e-9
    # Sensors at the tools and the motion under the known torques tell of the same work.
    largest = max(abs(row["received"]) for row in rows)
    assert max(abs(row["received"] - row["measured"]) for row in rows) < 0.3 * largest
    assert ros.call(Trigger, "controller/refill").success
    until(lambda: accounts.rows[-1]["refilled"] > 0.0, "the refilled tank")


def test_an_account_that_does_not_balance_is_said_to(ros: Ros) -> None:
    """Energy out of nothing is an error in the diagnostics, with its size and its bound."""
    stack = ros.stack(paper()).begin()
    stack.run_until(0.2)
    core = stack.nodes["controller"].core
    account = core.gate.account
    assert imbalance_text(account) == ""
    forged = replace(account, start=account.start - 0.01)
    assert imbalance_text(forged).startswith("the energy account does not balance: 0.0")
    core.gate._account = replace(core.gate.account, start=-1.0)
    until(stack.ear.says("controller", "does not balance"), "the error")
    assert stack.ear.status["controller"][0] == 2


def test_the_tank_s_levels_change_while_it_runs(ros: Ros) -> None:
    """A live key of the tank is in force at the next tick."""
    stack = ros.stack(paper()).begin()
    value = Parameter("tank.capacity", value=3.0).to_parameter_msg()
    request = SetParameters.Request(parameters=[value])
    assert ros.call(SetParameters, "controller/set_parameters", request).results[0].successful
    core = stack.nodes["controller"].core
    until(lambda: core.gate.settings.capacity == 3.0, "the new capacity")


def test_the_paper_s_experiment_stays_open(ros: Ros) -> None:
    """In the paper's experiment sigma and grip are 1 at every instant told."""
    accounts = Accounts(ros)
    ros.stack(paper()).begin().run_until(3.0)
    assert len(accounts.rows) > 600
    assert {(row["sigma"], row["grip"]) for row in accounts.rows} == {(1.0, 1.0)}
