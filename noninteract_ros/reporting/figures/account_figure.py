# SPDX-License-Identifier: Apache-2.0
"""The energy account of the port where the team is touched, drawn."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from noninteract_ros.arrays import Array
from noninteract_ros.reporting.figures.marks import mark_transitions
from noninteract_ros.reporting.metrics.passivity_observer import observe, surroundings_work
from noninteract_ros.reporting.metrics.team_account import TeamAccount, team_account
from noninteract_ros.reporting.recording.recorded import Recorded
from noninteract_ros.reporting.rendering.style import COLOURS, new_figure, styled

ROOM = 0.05  # above and below the gates


@styled
def account_figure(recorded: Recorded) -> Figure:
    """Energies, powers, the two gates, and what came in against what is still there.

    Raises:
        RecordingError: The recording lacks the account.
    """
    found = team_account(recorded)
    figure, (energies, powers, gates, sums) = new_figure(7.2, 4)
    _draw(energies, found.t, ("storage $T+\\nu U$", found.storage), ("tank $E$", found.tank))
    _draw(energies, found.t, ("reserve $R$", found.reserve), first=2)
    _draw(powers, found.t, ("supplied", found.supplied), ("dissipated", found.dissipated))
    _draw(powers, found.t, ("wanted by decoupling $P$", found.demand), first=2)
    # Under a law without gates there is nothing to show.
    sigma, grip = (np.where(found.gated, gate, np.nan) for gate in (found.sigma, found.grip))
    _draw(gates, found.t, ("$\\sigma$, of decoupling", sigma), ("$\\nu$, of impedance", grip))
    gates.lines[1].set_linestyle((0, (4, 3)))  # They often lie on each other.
    gates.set_ylim(-ROOM, 1.0 + ROOM)
    _draw(sums, found.t, ("received", _whole(found)), ("residual", found.residual))
    seen = surroundings_work(observe(recorded))
    sums.plot(*seen, color="black", linestyle=(0, (1, 2)), label="received, as observed")
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


def _whole(found: TeamAccount) -> Array:
    """What was received, across the starts of new accounts, shape (n,) [J]."""
    steps = np.diff(found.received, prepend=0.0)
    anew = np.diff(found.account, prepend=found.account[0]) != 0.0
    return np.asarray(np.cumsum(np.where(anew, found.received, steps)))
