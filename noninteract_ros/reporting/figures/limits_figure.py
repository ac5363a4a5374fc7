# SPDX-License-Identifier: Apache-2.0
"""Figure of torques relative to their limits and of the regularity of the subtasks."""

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.reporting.metrics.zero_order_hold import telemetry_rows
from noninteract_ros.reporting.recording.recorded import Recorded
from noninteract_ros.reporting.rendering.style import COLOURS, new_figure, styled


@styled
def limits_figure(recorded: Recorded) -> Figure:
    """Draw torques and the smallest singular value of the task Jacobian.

    Torques are relative to their limits if any joint has one.
    """
    figure, (shares, values) = new_figure(4.6, 2)
    rows = telemetry_rows(recorded)
    limits = recorded.team.effort_limits
    limited = bool(np.isfinite(limits).any())
    t, torque = recorded.t[rows], np.abs(recorded.torque[rows]) / (limits if limited else 1.0)
    for number, (name, part) in enumerate(
        zip(recorded.team.names, recorded.team.velocity_slices, strict=True)
    ):
        colour = COLOURS[number % len(COLOURS)]
        shares.plot(t, torque[:, part], color=colour, linewidth=0.5, alpha=0.6)
        shares.plot(t, torque[:, part].max(axis=1), color=colour, label=f"{name}, largest")
    shares.set_ylabel("torque / limit" if limited else "torque [N, N m]")
    shares.set_ylim(0.0, 1.05 if limited else None)
    handles, labels = shares.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=min(len(labels), 4))
    values.plot(t, _smallest_singular_values(recorded, rows), color=COLOURS[0])
    values.set_ylim(bottom=0.0)
    values.set_ylabel("smallest\nsingular value")
    values.set_xlabel("time [s]")
    values.set_xlim(t[0], t[-1])
    figure.align_ylabels([shares, values])
    return figure


def _smallest_singular_values(recorded: Recorded, rows: NDArray[np.intp]) -> Array:
    """Return the smallest singular value of the stacked Jacobian at states, shape (m,)."""
    still = np.zeros(recorded.team.n)
    states = (recorded.team.state(recorded.q[row], still) for row in rows)
    jacobians = [recorded.stack.evaluate(state).J for state in states]
    return np.linalg.svd(np.array(jacobians), compute_uv=False)[:, -1]
