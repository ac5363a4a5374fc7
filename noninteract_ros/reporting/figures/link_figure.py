# SPDX-License-Identifier: Apache-2.0
"""Figure of the energy account of the link between operator device and team."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from noninteract_ros.reporting.metrics.link_metrics import operator_net
from noninteract_ros.reporting.recording.recorded import Recorded
from noninteract_ros.reporting.recording.series import LabelledSeries
from noninteract_ros.reporting.rendering.style import COLOURS, new_figure, styled

PORTS = (("operator", "hand"), ("team", "team"))


@styled
def link_figure(recorded: Recorded, account: LabelledSeries) -> Figure:
    """Draw energies at both ports, the operator's balance with its bound, and budgets."""
    link = recorded.scenario.link
    t = recorded.since_start(account.stamps)
    figure, (ports, balance, budgets) = new_figure(5.6, 3)
    for colour, (port, name) in zip(COLOURS, PORTS, strict=False):
        ports.plot(t, account[f"{port}_in"], color=colour, label=f"{name}: in")
        ports.plot(t, account[f"{port}_out"], color=colour, linestyle="--", label=f"{name}: out")
    balance.plot(t, operator_net(account), color=COLOURS[0], label="operator net input")
    if link and link.passivity != "none":
        bound = -link.reserve - account["surprise"]
        balance.plot(t, bound, color=COLOURS[1], linestyle="--", label="bound")
    for colour, (end, name) in zip(COLOURS, (("device", "device"), PORTS[1]), strict=False):
        level = account[f"{end}_budget"]
        # Without passivity observers budgets are infinite.
        budgets.plot(t, np.where(np.isfinite(level), level, np.nan), color=colour, label=name)
    _finish(ports, "energy [J]")
    _finish(balance, "balance [J]")
    _finish(budgets, "budget [J]")
    budgets.set_xlabel("time [s]")
    budgets.set_xlim(t[0], t[-1])
    figure.align_ylabels([ports, balance, budgets])
    return figure


def _finish(axes: Axes, label: str) -> None:
    axes.set_ylabel(label)
    axes.legend(loc="best", ncols=2)
