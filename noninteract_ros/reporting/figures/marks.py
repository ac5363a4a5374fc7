# SPDX-License-Identifier: Apache-2.0
"""Marks of authority and of transitions in figures over time."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes

from noninteract_ros.control.references.subtask_input import AUTHORITIES
from noninteract_ros.reporting.metrics.intervals import segments
from noninteract_ros.reporting.recording.recorded import Recorded

LETTER = 0.013  # width of a letter relative to the figure's
LABEL = "stop or transition"
GREY = "0.9"


def transitions(recorded: Recorded) -> list[tuple[float, float]]:
    """Return start and end [s] of each transition of law or gains, stop or restart."""
    entry = recorded.energy_entry(recorded.stack.names[0], "transitions")
    if entry is None:
        return []
    t, counts = entry
    return [(t[first], t[last]) for first, last in segments(np.diff(counts) > 0.0)]


def mark_transitions(recorded: Recorded, rows: Sequence[Axes]) -> None:
    """Shade transitions; the first one in the first row has a label."""
    for number, (first, last) in enumerate(transitions(recorded)):
        for row, axes in enumerate(rows):
            label = None if number or row else LABEL
            axes.axvspan(first, last, color=GREY, linewidth=0.0, zorder=0, label=label)


def mark_leaders(recorded: Recorded, subtask: str, rows: Sequence[Axes]) -> None:
    """Draw dotted lines at changes of authority, with the name of the leading source.

    Short intervals have no name; runs with one source have no marks.
    """
    entry = recorded.energy_entry(subtask, "leader")
    if entry is None or not len(entry[0]):
        return
    t, leader = entry
    sources = [AUTHORITIES.index(name) for name in AUTHORITIES if name != "hold"]
    if len(set(leader.astype(int).tolist()) & set(sources)) < 2:
        return
    edges = [0, *(np.flatnonzero(np.diff(leader)) + 1).tolist(), len(t) - 1]
    for first, last in pairwise(edges):
        if first:
            for axes in rows:
                axes.axvline(t[first], color="0.4", linewidth=0.7, linestyle=":", zorder=1)
        name = AUTHORITIES[int(leader[first])]
        if t[last] - t[first] >= LETTER * len(name) * (t[-1] - t[0]):
            rows[0].annotate(
                name,
                (t[first], 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(2, 2),
                textcoords="offset points",
                va="bottom",
                fontsize=7,
                color="0.3",
            )
