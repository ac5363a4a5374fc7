# SPDX-License-Identifier: Apache-2.0
"""Energy metrics and passivity checks of the link between operator device and team."""

from typing import Any

from noninteract_ros.arrays import Array
from noninteract_ros.reporting.checks.checks import Check, at_least
from noninteract_ros.reporting.recording.recorded import Recorded
from noninteract_ros.reporting.recording.series import LabelledSeries

ROUNDING = 1e-9  # [J]


def link_account(recorded: Recorded) -> LabelledSeries | None:
    """Return the published account; None if the run has no link or did not record it."""
    haptic = recorded.scenario.haptic
    if haptic is None or not recorded.has(topic := f"{haptic.subtask}/link"):
        return None
    return recorded.run.labelled(topic)


def operator_net(account: LabelledSeries) -> Array:
    """Return the net energy that the operator put into the link, shape (n,) [J]."""
    return account["operator_in"] - account["operator_out"]


def link_metrics(recorded: Recorded) -> tuple[dict[str, Any], list[Check]]:
    """Return the final energies and the checks of the operator's energy balance.

    The bound is the reserve plus the largest overdraft of single ticks before they are observed.
    Without a passivity layer only the energies are reported.
    """
    account, link = link_account(recorded), recorded.scenario.link
    if account is None or link is None:
        return {}, []
    least = float(operator_net(account).min())
    names = ("operator_in", "operator_out", "team_in", "team_out")
    energies = {f"{name}_J": float(account[name][-1]) for name in names}
    metrics = {**energies, "least_operator_net_J": least, "lost": int(account["lost"][-1])}
    if link.passivity == "none":
        return {"link": metrics}, []
    debt, surprise = float(account["device_budget"].min()), float(account["surprise"][-1])
    metrics |= {"least_device_budget_J": debt, "surprise_J": surprise}
    bound = -link.reserve - surprise - ROUNDING
    return {"link": metrics}, [
        at_least("link.operator_net", least, bound, "J"),
        at_least("link.device_budget", debt, -surprise - ROUNDING, "J"),
    ]
