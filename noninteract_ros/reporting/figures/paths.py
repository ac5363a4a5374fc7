# SPDX-License-Identifier: Apache-2.0
"""Figure of tool paths and formations in the plane."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from noninteract_ros.arrays import Array
from noninteract_ros.reporting.recording.recorded import Recorded
from noninteract_ros.reporting.rendering.style import COLOURS, WIDTH, new_figure, styled
from noninteract_ros.reporting.rendering.tool_points import edges_of, tool_points
from noninteract_ros.team.robot import AXES

FORMATIONS = 9  # of a small team
FORMATIONS_OF_MANY = 4
APART = 0.07  # smallest distance of time labels relative to the width
FEW = 6  # largest number of robots with a colour and a name each


@styled
def paths_figure(recorded: Recorded) -> Figure:
    """Draw paths in the plane of the team's first two axes; over time for a single axis."""
    t, points = tool_points(recorded)
    used = [axis for axis in AXES if any(axis in robot.axes for robot in recorded.team.robots)]
    if len(used) > 1:
        across, up = (AXES.index(axis) for axis in used[:2])
        plan = points[:, :, [across, up]]
        width, height = np.ptp(plan, axis=(0, 1))
        figure, (axes,) = new_figure(float(np.clip(WIDTH * height / (width or 1.0), 2.4, 6.0)) + 1)
        axes.set_xlabel(f"{used[0]} [m]")
        axes.set_aspect("equal", adjustable="datalim")
    else:
        figure, (axes,) = new_figure(3.5)
        up = AXES.index(used[0])
        times = np.broadcast_to(t[:, None], points.shape[:2])
        plan = np.stack((times, points[:, :, up]), axis=2)
        axes.set_xlabel("time [s]")
    axes.set_ylabel(f"{used[-1] if len(used) < 2 else used[1]} [m]")
    _draw_paths(axes, recorded, plan)
    _draw_formations(axes, recorded, t, plan)
    figure.legend(loc="outside upper right", ncols=3 if len(recorded.team.names) <= FEW else 6)
    return figure


def _draw_paths(axes: Axes, recorded: Recorded, plan: Array) -> None:
    few = len(recorded.team.names) <= FEW
    for number, name in enumerate(recorded.team.names):
        colour = COLOURS[number] if few else COLOURS[0]
        axes.plot(
            *plan[:, number].T,
            color=colour,
            linewidth=1.0 if few else 0.5,
            alpha=0.9 if few else 0.5,
            label=name if few else None,
        )


def _draw_formations(axes: Axes, recorded: Recorded, t: Array, plan: Array) -> None:
    """Draw robots as dots joined by subtask edges, from light to dark over time."""
    few = len(recorded.team.names) <= FEW
    times = MaxNLocator(FORMATIONS if few else FORMATIONS_OF_MANY).tick_values(t[0], t[-1])
    times = times[(times >= t[0]) & (times <= t[-1])]
    instants = np.searchsorted(t, times - 1e-9)
    labelled: list[Array] = []
    edges = edges_of(recorded)
    for step, (time, row) in enumerate(zip(times, instants, strict=True)):
        shade = f"{0.7 * (1.0 - step / max(1, len(times) - 1)):.3f}"
        for first, second in edges:
            axes.plot(*plan[row, [first, second]].T, color=shade, linewidth=0.9, zorder=3)
        # Large teams have no room for text between robots.
        label = None if few else f"{time:g} s"
        size = 4.5 if few else 2.5
        axes.plot(*plan[row].T, "o", color=shade, markersize=size, zorder=4, label=label)
        middle = plan[row].mean(axis=0)
        apart = APART * np.ptp(plan[:, :, 0])
        if few and all(np.linalg.norm(middle - other) > apart for other in labelled):
            labelled.append(middle)
            axes.annotate(
                f"{time:g} s",
                middle,
                textcoords="offset points",
                xytext=(6, 2),
                fontsize=7,
                color=shade,
                zorder=5,
                bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5},
            )
