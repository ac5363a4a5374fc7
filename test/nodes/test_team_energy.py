# SPDX-License-Identifier: Apache-2.0
"""Energy account of the team: published values, diagnostics and refill."""

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
    """Return the scenario `door` with changes."""
    text = Path(ROOT / "config" / "door.yaml").read_text(encoding="utf-8")
    return merged(yaml.safe_load(text)["/**"]["ros__parameters"], changes)


class AccountMonitor:
    """Subscription to the energy account of the team."""

    def __init__(self, ros: Ros) -> None:
        self.rows: list[dict[str, float]] = []
        ros.probe.create_subscription(
            Float64MultiArray, "energy", self._on_account, 10_000, raw=True
        )

    def _on_account(self, data: bytes) -> None:
        message = deserialize_message(data, Float64MultiArray)
        labels = [dim.label for dim in message.layout.dim]
        assert tuple(labels) == ACCOUNT_LABELS
        self.rows.append(dict(zip(labels, message.data, strict=True)))


def test_the_account_at_the_door_balances(ros: Ros) -> None:
    """At the door sigma closes, diagnostics warn, the sums balance, and a refill is published."""
    accounts = AccountMonitor(ros)
    stack = ros.stack(door()).start()
    stack.run_until(3.0)
    stack.monitor.wait_for_status("controller", "energy tank was low")
    assert stack.monitor.status["controller"][0] == 1
    rows = list(accounts.rows)
    assert rows[0]["sigma"] == 1.0
    assert rows[-1]["sigma"] < 0.9
    for row in rows:
        assert abs(row["residual"] + row["lost"]) < 1e-9
        assert row["residual"] < 1e-9
    # Wrench sensors and the motion under the known torques give the same work.
    largest = max(abs(row["received"]) for row in rows)
    assert max(abs(row["received"] - row["measured"]) for row in rows) < 0.3 * largest
    assert ros.call(Trigger, "controller/refill").success
    until(lambda: accounts.rows[-1]["refilled"] > 0.0, "the refilled tank")


def test_an_account_that_does_not_balance_is_an_error(ros: Ros) -> None:
    """Diagnostics show created energy with its amount and its bound."""
    stack = ros.stack(paper()).start()
    stack.run_until(0.2)
    core = stack.nodes["controller"].core
    account = core.gate.account
    assert imbalance_text(account) == ""
    wrong = replace(account, start=account.start - 0.01)
    assert imbalance_text(wrong).startswith("the energy account does not balance: 0.0")
    core.gate._account = replace(core.gate.account, start=-1.0)
    stack.monitor.wait_for_status("controller", "does not balance")
    assert stack.monitor.status["controller"][0] == 2


def test_tank_levels_are_live_parameters(ros: Ros) -> None:
    """A changed level is in force at the next tick."""
    stack = ros.stack(paper()).start()
    value = Parameter("tank.capacity", value=3.0).to_parameter_msg()
    request = SetParameters.Request(parameters=[value])
    assert ros.call(SetParameters, "controller/set_parameters", request).results[0].successful
    core = stack.nodes["controller"].core
    until(lambda: core.gate.settings.capacity == 3.0, "the new capacity")


def test_the_gates_stay_open_in_the_paper_experiment(ros: Ros) -> None:
    """Both gates are 1 in every published account."""
    accounts = AccountMonitor(ros)
    ros.stack(paper()).start().run_until(3.0)
    assert len(accounts.rows) > 600
    assert {(row["sigma"], row["nu"]) for row in accounts.rows} == {(1.0, 1.0)}
