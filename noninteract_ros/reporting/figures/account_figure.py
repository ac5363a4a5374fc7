# SPDX-License-Identifier: Apache-2.0
"""Figure of the team's energy account at its external port."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from noninteract_ros.arrays import Array
from noninteract_ros.reporting.figures.marks import mark_transitions
from noninteract_ros.reporting.metrics.passivity_observer import external_work, observe
from noninteract_ros.reporting.metrics.team_account import TeamAccount, team_account
from noninteract_ros.reporting.recording.recorded import Recorded
from noninteract_ros.reporting.rendering.style import COLOURS, new_figure, styled

MARGIN = 0.05  # above and below the gates


@styled
def account_figure(recorded: Recorded) -> Figure:
    """Draw energies, powers, gates, and received energy with its residual.

    Raises:
        RecordingError: The recording lacks the account.
    """
    found = team_account(recorded)
    figure, (energies, powers, gates, sums) = new_figure(7.2, 4)
    _draw(energies, found.t, ("storage $T+\\nu U$", found.storage), ("tank $E$", found.tank))
    _draw(energies, found.t, ("reserve $R$", found.reserve), first=2)
    _draw(powers, found.t, ("supplied", found.supplied), ("dissipated", found.dissipated))
    _draw(powers, found.t, ("decoupling demand $P$", found.demand), first=2)
    # Laws without gates have no curves.
    sigma, nu = (np.where(found.gated, gate, np.nan) for gate in (found.sigma, found.nu))
    _draw(gates, found.t, ("decoupling $\\sigma$", sigma), ("springs $\\nu$", nu))
    gates.lines[1].set_linestyle((0, (4, 3)))  # The curves often coincide.
    gates.set_ylim(-MARGIN, 1.0 + MARGIN)
    _draw(sums, found.t, ("received", _cumulative(found)), ("residual", found.residual))
    observed = external_work(observe(recorded))
    sums.plot(*observed, color="black", linestyle=(0, (1, 2)), label="received (observer)")
    if not found.gated.any():
        note = f"law {recorded.scenario.general.law} has no gates"
        gates.text(0.5, 0.5, note, transform=gates.transAxes, ha="center", va="center")
    mark_transitions(recorded, (gates, energies, powers, sums))
    labels = ("energy [J]", "power [W]", "gate", "energy [J]")
    for axes, label in zip((energies, powers, gates, sums), labels, strict=True):
        axes.set_ylabel(label)
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 0.98), ncols=3, borderaxespad=0.0)
        axes.margins(x=0.0)
    sums.axhline(0.0, color="black", linewidth=0.6, zorder=1)
    sums.set_xlabel("time [s]")
    figure.align_ylabels([energies, powers, gates, sums])
    return figure


def _draw(axes: Axes, t: Array, *curves: tuple[str, Array], first: int = 0) -> None:
    for number, (label, values) in enumerate(curves, start=first):
        axes.plot(t, values, color=COLOURS[number], label=label)


def _cumulative(found: TeamAccount) -> Array:
    """Return the received energy across resets of the account, shape (n,) [J]."""
    steps = np.diff(found.received, prepend=0.0)
    reset = np.diff(found.account, prepend=found.account[0]) != 0.0
    return np.asarray(np.cumsum(np.where(reset, found.received, steps)))
