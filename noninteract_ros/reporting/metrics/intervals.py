# SPDX-License-Identifier: Apache-2.0
"""Intervals between recorded states over which properties of the law can be checked.

Each mask is True for the intervals in which its condition holds, shape (n - 1,).
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.decoupling import DECOUPLING_LAWS, LAWS
from noninteract_ros.reporting.recording.recorded import Recorded, RecordedMotion, common_times
from noninteract_ros.reporting.recording.series import LabelledSeries
from noninteract_ros.subtasks.layout import Layout

COUNTERS = ("interventions", "transitions")
JUMP = 1e-4  # [m; rad] smallest deviation from the extrapolated path that counts as a jump


def by_law_alone(series: LabelledSeries, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return True where only the law and gains in force determined the torques.

    False during joint limits, singularities, closed gates, transitions, stops and restarts.

    Args:
        series: Energy entries of a subtask.
        rows: Rows to consider.
    """
    alone = np.ones(max(len(rows) - 1, 0), dtype=bool)
    for label in COUNTERS:
        if label in series.labels:
            same = np.diff(series[label][rows]) == 0.0
            # An event counted at the start of an interval acts during it.
            alone &= same & np.concatenate(([True], same[:-1]))[: len(same)]
    return alone


def laws(recorded: Recorded, t: Array) -> NDArray[np.str_]:
    """Return the law in force at times t, shape (n,); the scenario's where not recorded."""
    found = np.full(len(t), recorded.scenario.general.law, dtype="<U32")
    if (entry := recorded.energy_entry(recorded.stack.names[0], "law")) is not None:
        rows, others = common_times(t, entry[0])
        found[rows] = np.array(LAWS)[entry[1][others].astype(int)]
    return found


def decoupling_in_force(law: NDArray[np.str_]) -> NDArray[np.bool_]:
    """Return True where a decoupling law was in force, from the law at each time (n,)."""
    does = np.isin(law, DECOUPLING_LAWS)
    return np.asarray(does[1:] & does[:-1])


def continuous_steps(recorded: Recorded) -> NDArray[np.bool_]:
    """Return True where a state follows from the previous one by continuous motion, not a reset.

    Velocities within an interval lie between those at its ends up to third order in time.
    """
    h, v = np.diff(recorded.t)[:, None], recorded.v
    off = np.abs(recorded.steps - 0.5 * h * (v[1:] + v[:-1]))
    return np.asarray(~(off > JUMP + 0.5 * h * np.abs(v[1:] - v[:-1])).any(axis=1))


def continuous_between(recorded: Recorded, t: Array) -> NDArray[np.bool_]:
    """Return True where the team moved continuously from each time to the next."""
    resets = recorded.t[1:][~continuous_steps(recorded)]
    return np.asarray(np.diff(np.searchsorted(resets, t + 1e-9)) == 0)


def reference_at_rest(desired: RecordedMotion) -> NDArray[np.bool_]:
    """Return True where the reference is at rest."""
    rest = (desired.velocity == 0.0).all(axis=1) & (desired.acceleration == 0.0).all(axis=1)
    same = (desired.position[1:] == desired.position[:-1]).all(axis=1)
    return np.asarray(rest[1:] & rest[:-1] & same)


def reference_jumps(layout: Layout, desired: RecordedMotion) -> NDArray[np.bool_]:
    """Return True where the reference jumps in position or velocity."""
    h = np.diff(desired.t)[:, None]
    x, v, a = desired.position, desired.velocity, desired.acceleration
    way = layout.difference(x[1:], x[:-1])
    ahead = way - h * v[:-1] - 0.5 * h * h * a[:-1]
    back = way - h * v[1:] + 0.5 * h * h * a[1:]
    gap = np.minimum(np.abs(ahead), np.abs(back))
    # The position gap shows only half of a jump in velocity.
    kick = np.abs(v[1:] - v[:-1] - 0.5 * h * (a[1:] + a[:-1]))
    return np.asarray(((gap > JUMP) | (h * kick > JUMP)).any(axis=1))


def pushes_measured(recorded: Recorded, t: Array) -> NDArray[np.bool_]:
    """Return True where all scheduled pushes act on tools, and so are measured."""
    measured = np.ones(max(len(t) - 1, 0), dtype=bool)
    for push in recorded.scenario.pushes.values():
        if not push.on_tool(recorded.team):
            measured &= (t[1:] <= push.start) | (t[:-1] >= push.start + push.duration)
    return measured


def undisturbed(recorded: Recorded, t: Array) -> NDArray[np.bool_]:
    """Return True where no external wrench was measured on any robot."""
    free = np.ones(len(t), dtype=bool)
    for robot in recorded.scenario.robots:
        if not recorded.has(f"{robot}/external_wrench"):
            return np.zeros(max(len(t) - 1, 0), dtype=bool)
        series = recorded.run.wrench(f"{robot}/external_wrench")
        rows, others = common_times(t, recorded.since_start(series.stamps))
        known = np.zeros(len(t), dtype=bool)
        known[rows] = ~(series.force[others].any(axis=1) | series.torque[others].any(axis=1))
        free &= known
    return np.asarray(free[1:] & free[:-1]) & pushes_measured(recorded, t)


def segments(holds: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return first and last index of each contiguous segment in which a mask holds."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], holds, [False])).astype(int)))
    return [(first, last) for first, last in pairwise(edges.tolist()) if holds[first]]
