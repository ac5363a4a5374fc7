# SPDX-License-Identifier: Apache-2.0
"""Over which intervals between recorded instants a claim about the law can be judged.

Each function returns, from each instant to the next, whether something holds, shape (n - 1,).
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.decoupling import DECOUPLING_LAWS, LAWS
from noninteract_ros.reporting.recording.recorded import Recorded, RecordedMotion, common_instants
from noninteract_ros.reporting.recording.series import LabelledSeries
from noninteract_ros.subtasks.layout import Layout

COUNTERS = ("interventions", "transitions")
JUMP = 1e-4  # [m; rad] what leaves its own path by more has jumped


def by_law_alone(series: LabelledSeries, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Whether law and gains in force alone made the torques.

    No limit of a joint, singularity or gate, no change that fades in, no stop and no new start.

    Args:
        series: Account of a subtask.
        rows: Its instants that count.
    """
    alone = np.ones(max(len(rows) - 1, 0), dtype=bool)
    for label in COUNTERS:
        if label in series.labels:
            same = np.diff(series[label][rows]) == 0.0
            # What was counted at the start of an interval acted in it.
            alone &= same & np.concatenate(([True], same[:-1]))[: len(same)]
    return alone


def laws(recorded: Recorded, t: Array) -> NDArray[np.str_]:
    """Law in force at some times, shape (n,): the scenario's, where nobody told of it."""
    found = np.full(len(t), recorded.scenario.general.law, dtype="<U32")
    if (told := recorded.told(recorded.stack.names[0], "law")) is not None:
        rows, others = common_instants(t, told[0])
        found[rows] = np.array(LAWS)[told[1][others].astype(int)]
    return found


def decoupled(law: NDArray[np.str_]) -> NDArray[np.bool_]:
    """Whether a law that decouples was in force, from the laws at each instant, shape (n,)."""
    does = np.isin(law, DECOUPLING_LAWS)
    return np.asarray(does[1:] & does[:-1])


def moved_by_itself(recorded: Recorded) -> NDArray[np.bool_]:
    """Whether the team can have come from each recorded state to the next: nobody put it there.

    Velocities in between lie between those at both ends but for what is of third order in time.
    """
    h, v = np.diff(recorded.t)[:, None], recorded.v
    off = np.abs(recorded.steps - 0.5 * h * (v[1:] + v[:-1]))
    return np.asarray(~(off > JUMP + 0.5 * h * np.abs(v[1:] - v[:-1])).any(axis=1))


def without_jumps(recorded: Recorded, t: Array) -> NDArray[np.bool_]:
    """Whether the team moved by itself from each of some times to the next."""
    put = recorded.t[1:][~moved_by_itself(recorded)]
    return np.asarray(np.diff(np.searchsorted(put, t + 1e-9)) == 0)


def still(desired: RecordedMotion) -> NDArray[np.bool_]:
    """Whether the reference stands still."""
    rest = (desired.velocity == 0.0).all(axis=1) & (desired.acceleration == 0.0).all(axis=1)
    same = (desired.position[1:] == desired.position[:-1]).all(axis=1)
    return np.asarray(rest[1:] & rest[:-1] & same)


def jumps(layout: Layout, desired: RecordedMotion) -> NDArray[np.bool_]:
    """Whether the reference jumps."""
    h = np.diff(desired.t)[:, None]
    x, v, a = desired.position, desired.velocity, desired.acceleration
    way = layout.difference(x[1:], x[:-1])
    ahead = way - h * v[:-1] - 0.5 * h * h * a[:-1]
    back = way - h * v[1:] + 0.5 * h * h * a[1:]
    gap = np.minimum(np.abs(ahead), np.abs(back))
    # A jump in velocity alone shows as one in position only half as well.
    kick = np.abs(v[1:] - v[:-1] - 0.5 * h * (a[1:] + a[:-1]))
    return np.asarray(((gap > JUMP) | (h * kick > JUMP)).any(axis=1))


def felt(recorded: Recorded, t: Array) -> NDArray[np.bool_]:
    """Whether tools feel all that pushes."""
    told = np.ones(max(len(t) - 1, 0), dtype=bool)
    for push in recorded.scenario.pushes.values():
        if not push.on_tool(recorded.team):
            told &= (t[1:] <= push.start) | (t[:-1] >= push.start + push.duration)
    return told


def untouched(recorded: Recorded, t: Array) -> NDArray[np.bool_]:
    """Whether nothing acts from outside."""
    free = np.ones(len(t), dtype=bool)
    for robot in recorded.scenario.robots:
        if not recorded.has(f"{robot}/external_wrench"):
            return np.zeros(max(len(t) - 1, 0), dtype=bool)
        series = recorded.run.wrench(f"{robot}/external_wrench")
        rows, others = common_instants(t, recorded.since_start(series.stamps))
        known = np.zeros(len(t), dtype=bool)
        known[rows] = ~(series.force[others].any(axis=1) | series.torque[others].any(axis=1))
        free &= known
    return np.asarray(free[1:] & free[:-1]) & felt(recorded, t)


def pieces(holds: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last instant of each piece in which every step holds."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], holds, [False])).astype(int)))
    return [(first, last) for first, last in pairwise(edges.tolist()) if holds[first]]
