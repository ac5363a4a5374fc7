# SPDX-License-Identifier: Apache-2.0
"""Storage functions (32) of a run and their rates (33): what a passive subtask must show."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.analysis.checks import Check, at_least, at_most, not_applicable
from noninteract_ros.analysis.recorded import Motion, Recorded, common_instants, select
from noninteract_ros.arrays import Array

LAWS = ("noninteracting", "paper")
GROWTH = 1e-8  # share of the peak at 1 kHz: what holding the torque over a tick can leave
PASSIVE = 1e-3  # share of the peak at 1 kHz by which (31) may be missed for the same reason
SAMPLED = 0.02  # share of the peak at 1 kHz: powers are sampled where the torque is fresh
JUMP = 1e-4  # [m] a desired motion that leaves its own path by more has jumped


@dataclass(frozen=True)
class Account:
    """The energy account of one subtask.

    Attributes:
        t: Time of the run, shape (n,) [s].
        storage: Shape (n,) [J].
        rate: Shape (n,) [W].
        supplied: Power from outside, shape (n,) [W].
        desired: Desired motion at the same instants.
    """

    t: Array
    storage: Array
    rate: Array
    supplied: Array
    desired: Motion


def account(recorded: Recorded, subtask: str) -> Account:
    """The energy account of a subtask as the controller told it.

    Raises:
        RecordingError: A topic is missing or of another type.
    """
    series = recorded.run.labelled(f"{subtask}/energy")
    t = recorded.since_start(series.stamps)
    desired = recorded.motion(f"{subtask}/desired", subtask)
    rows, others = common_instants(t, desired.t)
    storage, rate, supplied = (series[key][rows] for key in ("storage", "rate", "supplied"))
    return Account(t[rows], storage, rate, supplied, select(desired, others))


def energy_metrics(recorded: Recorded, subtask: str) -> tuple[dict[str, Any], list[Check]]:
    """Sign, growth and consistency of one subtask's storage function.

    Raises:
        RecordingError: A topic is missing or of another type.
    """
    found = account(recorded, subtask)
    peak = float(found.storage.max(initial=0.0))
    growth, growth_reason = _growth(recorded, subtask, found)
    excess, mismatch, blind = _against_supply(recorded, subtask, found)
    excess_reason = blind or _crossing(recorded)
    lowest = float(found.storage.min(initial=np.inf))
    metrics = {
        "storage_min_J": lowest,
        "storage_max_J": peak,
        "storage_final_J": float(found.storage[-1]),
        "growth_while_undisturbed_J": growth,
        "growth_reason": growth_reason or None,
        "rise_beyond_supply_J": None if blind else excess,
        "rate_mismatch_J": None if blind else mismatch,
        "rate_reason": blind or None,
    }
    coarse = 1000.0 / recorded.rate
    sampled = SAMPLED * peak * coarse
    claims = (
        ("growth", growth or 0.0, GROWTH * peak * coarse**3, growth_reason),
        ("passive", excess, PASSIVE * peak * coarse, excess_reason),
        ("rate", mismatch, sampled, blind),
    )
    checks = [at_least(f"storage_positive.{subtask}", lowest, 0.0, "J")]
    for claim, value, limit, reason in claims:
        name = f"storage_{claim}.{subtask}"
        checks.append(
            not_applicable(name, limit, "J", reason)
            if reason
            else at_most(name, value, limit, "J")
        )
    return metrics, checks


def _crossing(recorded: Recorded) -> str:
    """Why a subtask's storage may grow at the cost of another's, or an empty text."""
    law = recorded.scenario.general.law
    return "" if law in LAWS else f"under law {law} other subtasks supply it too"


def _rotating(recorded: Recorded, subtask: str) -> str:
    """Why stillness and jumps of a reference cannot be told, or an empty text."""
    return "its desired rotations are not looked at" if recorded.task(subtask).rotates else ""


def _growth(recorded: Recorded, subtask: str, found: Account) -> tuple[float | None, str]:
    """Largest growth over any time with a still reference and nothing that acts from outside."""
    if reason := _crossing(recorded) or _rotating(recorded, subtask):
        return None, reason
    quiet = np.logical_and(_still(found.desired), _untouched(recorded, found.t))
    if not quiet.any():
        return None, "no time with a still reference and without external force"
    largest = 0.0
    for first, last in _runs(quiet):
        storage = found.storage[first : last + 1]
        lowest = np.minimum.accumulate(storage)
        largest = max(largest, float((storage - lowest).max()))
    return largest, ""


def _against_supply(recorded: Recorded, subtask: str, found: Account) -> tuple[float, float, str]:
    """Storage against integrated powers, over pieces without a jump of the reference.

    Returns:
        Largest rise beyond what was supplied (31) [J], largest difference from the integrated
        rate (33) [J], and why neither can be told, or an empty text.
    """
    loaded = recorded.scenario.held is not None or recorded.scenario.pushes
    unseen = set(recorded.scenario.robots) - set(recorded.scenario.general.force_sensors)
    if loaded and unseen:
        return 0.0, 0.0, "the controller has no force sensors on every robot"
    if reason := _rotating(recorded, subtask):
        return 0.0, 0.0, reason
    excess = mismatch = 0.0
    for first, last in _runs(~_jumps(found.desired)):
        piece = slice(first, last + 1)
        gain = found.storage[piece] - found.storage[first]
        unsupplied = gain - _integral(found.t[piece], found.supplied[piece])
        excess = max(excess, float((unsupplied - np.minimum.accumulate(unsupplied)).max()))
        rest = gain - _integral(found.t[piece], found.rate[piece])
        mismatch = max(mismatch, float(np.abs(rest).max()))
    return excess, mismatch, ""


def _integral(t: Array, power: Array) -> Array:
    """Energy since the first instant by the trapezoidal rule, shape (n,) [J]."""
    return np.concatenate(([0.0], np.cumsum(np.diff(t) * (power[1:] + power[:-1]) / 2)))


def _still(desired: Motion) -> NDArray[np.bool_]:
    """Whether the reference stands still from each instant to the next, shape (n - 1,)."""
    rest = (desired.velocity == 0.0).all(axis=1) & (desired.acceleration == 0.0).all(axis=1)
    same = (desired.position[1:] == desired.position[:-1]).all(axis=1)
    return np.asarray(rest[1:] & rest[:-1] & same)


def _jumps(desired: Motion) -> NDArray[np.bool_]:
    """Whether the reference jumps between each instant and the next, shape (n - 1,)."""
    h = np.diff(desired.t)[:, None]
    x, v, a = desired.position, desired.velocity, desired.acceleration
    ahead = x[:-1] + h * v[:-1] + 0.5 * h * h * a[:-1]
    back = x[1:] - h * v[1:] + 0.5 * h * h * a[1:]
    gap = np.minimum(np.abs(x[1:] - ahead), np.abs(x[:-1] - back))
    # A jump in velocity alone shows as one in position only half as well.
    kick = np.abs(v[1:] - v[:-1] - 0.5 * h * (a[1:] + a[:-1]))
    return np.asarray(((gap > JUMP) | (h * kick > JUMP)).any(axis=1))


def _untouched(recorded: Recorded, t: Array) -> NDArray[np.bool_]:
    """Whether nothing acts from outside from each instant to the next, shape (n - 1,)."""
    free = np.ones(len(t), dtype=bool)
    for robot in recorded.scenario.robots:
        if not recorded.has(f"{robot}/external_wrench"):
            return np.zeros(max(len(t) - 1, 0), dtype=bool)
        series = recorded.run.wrench(f"{robot}/external_wrench")
        rows, others = common_instants(t, recorded.since_start(series.stamps))
        known = np.zeros(len(t), dtype=bool)
        known[rows] = ~(series.force[others].any(axis=1) | series.torque[others].any(axis=1))
        free &= known
    return np.asarray(free[1:] & free[:-1])


def _runs(holds: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last instant of each piece in which every step holds."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], holds, [False])).astype(int)))
    return [(first, last) for first, last in pairwise(edges.tolist()) if holds[first]]
