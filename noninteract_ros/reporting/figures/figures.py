# SPDX-License-Identifier: Apache-2.0
"""Tracking and storage figures of the paper's Section V, and the set of all figures."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from noninteract_ros.arrays import Array
from noninteract_ros.errors import RecordingError
from noninteract_ros.reporting.figures.account_figure import account_figure
from noninteract_ros.reporting.figures.limits_figure import limits_figure
from noninteract_ros.reporting.figures.link_figure import link_figure
from noninteract_ros.reporting.figures.marks import mark_leaders, mark_transitions, transitions
from noninteract_ros.reporting.figures.paths import paths_figure
from noninteract_ros.reporting.metrics.link_metrics import link_account
from noninteract_ros.reporting.metrics.storage_functions import StorageBalance, storage_balance
from noninteract_ros.reporting.recording.recorded import Recorded, Tracking, select
from noninteract_ros.reporting.rendering.animation import Animation, motion_figure, save_animation
from noninteract_ros.reporting.rendering.style import COLOURS, DASHES, new_figure, save, styled
from noninteract_ros.subtasks.subtask import Subtask

FEW = 3  # largest number of elements with a colour each
LEGEND_WIDTH = 80  # characters in a row of a legend; a line sample takes six


def draw(recorded: Recorded, folder: Path) -> tuple[list[Path], list[str]]:
    """Draw all figures for which a run has data.

    Args:
        recorded: The run.
        folder: Existing output folder.

    Returns:
        The files, and the reason for each missing figure.
    """
    files, missing = [], []
    for number, name in enumerate(recorded.stack.names):
        # The paper's Fig. 2 shows its first subtask, Fig. 3 its second.
        prefix = f"fig{number + 2}" if number < 2 else "tracking"
        try:
            figure = tracking_figure(recorded, name)
            files.append(save(figure, folder / f"{prefix}_{name}.png"))
        except RecordingError as error:
            missing.append(str(error))
    try:
        files.append(save(storage_figure(recorded), folder / "fig4_storage.png"))
    except RecordingError as error:
        missing.append(str(error))
    try:
        files.append(save(account_figure(recorded), folder / "fig5_energy.png"))
    except RecordingError as error:
        missing.append(str(error))
    files.append(save(paths_figure(recorded), folder / "paths.png"))
    if link := link_account(recorded):
        files.append(save(link_figure(recorded, link), folder / "link.png"))
    if not recorded.constant:
        files.append(save(limits_figure(recorded), folder / "limits.png"))
    try:
        animation = Animation(recorded)
        files.append(save(motion_figure(animation), folder / "motion.png"))
        files.append(save_animation(animation, folder / "motion.gif"))
    except RecordingError as error:
        missing.append(str(error))
    return files, missing


@styled
def tracking_figure(recorded: Recorded, subtask: str) -> Figure:
    """Draw desired (dashed) and actual (solid) coordinates over time, one row per world axis.

    Raises:
        RecordingError: The recording lacks the subtask's state or desired value.
    """
    tracking, task = recorded.tracking(subtask), recorded.task(subtask)
    plain = task.layout.values
    shape = (len(tracking.t), len(task.elements), len(task.axes))
    actual = tracking.actual.position[:, plain].reshape(shape)
    desired = tracking.desired.position[:, plain].reshape(shape)
    count = len(task.axes) + task.rotates
    figure, rows = new_figure(1.0 + 1.45 * count, count)
    for column, axis in enumerate(task.axes):
        axes = rows[column]
        draw_one = _draw_few if len(task.elements) <= FEW else _draw_many
        draw_one(axes, tracking, actual[:, :, column], desired[:, :, column], task.elements)
        units = ", ".join(dict.fromkeys(task.element_units))
        named = f"{axis} [{units}]" if units == "m" else f"[{units}]"
        axes.set_ylabel(f"{_quantity(subtask, task.elements)}\n{named}")
        axes.margins(x=0.0)
    if task.rotates:
        _draw_angles(rows[-1], tracking, task)
    mark_transitions(recorded, rows)
    mark_leaders(recorded, subtask, rows)
    rows[-1].set_xlabel("time [s]")
    figure.align_ylabels(rows)
    # A legend above the axes never covers a curve.
    handles, labels = rows[0].get_legend_handles_labels()
    columns = min(len(labels), max(2, LEGEND_WIDTH // (6 + max(map(len, labels)))))
    columns -= columns % 2 if len(labels) > columns else 0  # Keep pairs in one column.
    figure.legend(handles, labels, loc="outside upper right", ncols=columns)
    return figure


def _draw_angles(axes: Axes, tracking: Tracking, task: Subtask) -> None:
    """Draw the angle between actual and desired rotation of each element."""
    e = task.layout.difference(tracking.actual.position, tracking.desired.position)
    angles = np.linalg.norm(e[:, task.layout.angular], axis=2)
    lines = axes.plot(tracking.t, angles, color=COLOURS[1], linewidth=1.0)
    lines[0].set_label("angle error")
    axes.set_ylabel(f"{'orientation' if task.axes else task.name}\nerror [rad]")
    axes.margins(x=0.0)


def _quantity(subtask: str, elements: tuple[str, ...]) -> str:
    """Return the axis label: a distance between robots, or the name of the subtask."""
    return "distance" if all("-" in element for element in elements) else subtask


def _draw_few(
    axes: Axes, tracking: Tracking, actual: Array, desired: Array, elements: tuple[str, ...]
) -> None:
    """Draw each element in its own colour."""
    for number, element in enumerate(elements):
        of = f" {element}" if len(elements) > 1 else ""
        colour = COLOURS[number]
        axes.plot(tracking.t, actual[:, number], color=colour, label=f"actual{of}")
        desired_colour = "black" if len(elements) == 1 else colour
        axes.plot(
            tracking.t,
            desired[:, number],
            color=desired_colour,
            linestyle=(0, (5, 2.5)),
            linewidth=1.1,
            label=f"desired{of}",
        )


def _draw_many(
    axes: Axes, tracking: Tracking, actual: Array, desired: Array, elements: tuple[str, ...]
) -> None:
    """Draw all elements in the same style."""
    count = len(elements)
    solid = axes.plot(tracking.t, actual, color=COLOURS[0], linewidth=0.6, alpha=0.7)
    dashed = axes.plot(
        tracking.t, desired, color="black", linewidth=0.6, linestyle=(0, (5, 4)), alpha=0.8
    )
    solid[0].set_label(f"actual, {count} elements")
    dashed[0].set_label("desired")


@styled
def storage_figure(recorded: Recorded) -> Figure:
    """Draw storage functions (top) and their rates (bottom), each from its subtask's start on.

    Runs with stops or transitions are drawn over the time of the run.

    Raises:
        RecordingError: The recording lacks an energy.
    """
    names, interrupted = recorded.stack.names, bool(transitions(recorded))
    figure, (storages, rates) = new_figure(4.2, 2)
    for number, name in enumerate(names):
        t, found = _aligned(recorded, name)
        t = found.t if interrupted else t
        for axes, values, symbol in (
            (storages, found.storage, "S"),
            (rates, found.rate, r"\dot{S}"),
        ):
            axes.plot(
                t,
                values,
                color=COLOURS[number % len(COLOURS)],
                linestyle=DASHES[number % len(DASHES)],
                label=_symbol_label(symbol, name, names),
            )
    storages.set_ylabel("storage [J]")
    rates.set_ylabel("rate of storage [W]")
    figure.align_ylabels([storages, rates])
    rates.set_xlabel("time [s]" if interrupted else "time since the subtask's start [s]")
    for axes in (storages, rates):
        axes.axhline(0.0, color="black", linewidth=0.6, zorder=1)
    mark_transitions(recorded, (storages, rates))
    handles, labels = storages.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=3)
    storages.set_xlim(0.0, recorded.t[-1] if interrupted else _settling_time(recorded))
    return figure


def _aligned(recorded: Recorded, subtask: str) -> tuple[Array, StorageBalance]:
    """Return time since the subtask's start and the balance from there on."""
    found = storage_balance(recorded, subtask)
    start = recorded.start(subtask)
    since = found.t - (found.t[0] if start is None else start)
    rows = since >= -1e-9
    columns = ("t", "storage", "rate", "supplied", "velocity_error")
    selected = {name: getattr(found, name)[rows] for name in columns}
    return since[rows], replace(found, desired=select(found.desired, rows), **selected)


def _settling_time(recorded: Recorded) -> float:
    """Return twice the time until every storage function has settled [s].

    The whole duration if one does not settle.
    """
    settled = []
    for name in recorded.stack.names:
        t, found = _aligned(recorded, name)
        longest = t[-1] if len(t) else 0.0
        level = found.storage[-len(found.storage) // 4 :].max(initial=0.0)
        peak = found.storage.max(initial=0.0)
        above = found.storage > level + 0.02 * peak
        if level > 0.5 * peak:  # It does not settle.
            settled.append(longest)
        else:
            settled.append(t[np.flatnonzero(above)[-1]] if above.any() else 0.0)
    return float(np.clip(2.0 * max(settled), min(1.0, longest), longest)) or 1.0


def _symbol_label(symbol: str, name: str, names: tuple[str, ...]) -> str:
    """Return the symbol of a subtask, such as S_c or S_r, or its name if initials coincide."""
    initials = [other[0] for other in names]
    index = name[0] if initials.count(name[0]) == 1 else name.replace("_", r"\_")
    letter = f"${symbol}_{{{index}}}$" if len(index) == 1 else f"${symbol}$ {name}"
    return f"{letter} ({name})" if len(index) == 1 else letter
