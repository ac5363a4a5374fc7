# SPDX-License-Identifier: Apache-2.0
"""What a reader of a figure over time should know: who led, and when the law was not alone."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes

from noninteract_ros.control.references.subtask_input import AUTHORITIES
from noninteract_ros.reporting.metrics.intervals import pieces
from noninteract_ros.reporting.recording.recorded import Recorded

LETTER = 0.013  # share of a figure's width that a letter takes
LABEL = "stop or change"
GREY = "0.9"


def transitions(recorded: Recorded) -> list[tuple[float, float]]:
    """Times [s] in which a change of law or gains faded in, a stop or a new start had a part."""
    told = recorded.told(recorded.stack.names[0], "transitions")
    if told is None:
        return []
    t, counts = told
    return [(t[first], t[last]) for first, last in pieces(np.diff(counts) > 0.0)]


def mark_transitions(recorded: Recorded, rows: Sequence[Axes]) -> None:
    """Shades them; only the first one in the first row has a label."""
    for number, (first, last) in enumerate(transitions(recorded)):
        for row, axes in enumerate(rows):
            label = None if number or row else LABEL
            axes.axvspan(first, last, color=GREY, linewidth=0.0, zorder=0, label=label)


def mark_leaders(recorded: Recorded, subtask: str, rows: Sequence[Axes]) -> None:
    """Dotted lines where somebody else begins to lead, and who, if there are several who do.

    A while that is too short for a word has none.
    """
    told = recorded.told(subtask, "leader")
    if told is None or not len(told[0]):
        return
    t, leader = told
    sources = [AUTHORITIES.index(name) for name in AUTHORITIES if name != "hold"]
    if len(set(leader.astype(int).tolist()) & set(sources)) < 2:
        return
    edges = [0, *(np.flatnonzero(np.diff(leader)) + 1).tolist(), len(t) - 1]
    for first, last in pairwise(edges):
        if first:
            for axes in rows:
                axes.axvline(t[first], color="0.4", linewidth=0.7, linestyle=":", zorder=1)
        word = AUTHORITIES[int(leader[first])]
        if t[last] - t[first] >= LETTER * len(word) * (t[-1] - t[0]):
            rows[0].annotate(
                word,
                (t[first], 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(2, 2),
                textcoords="offset points",
                va="bottom",
                fontsize=7,
                color="0.3",
            )
