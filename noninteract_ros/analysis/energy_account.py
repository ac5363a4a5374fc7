# SPDX-License-Identifier: Apache-2.0
"""Storage functions (32) of a run and their rates (33): what a passive subtask must show."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.analysis.checks import Check, at_least, at_most, not_applicable
from noninteract_ros.analysis.holding import Holding
from noninteract_ros.analysis.recorded import (
    FRICTION,
    INTERVENTIONS,
    Motion,
    Recorded,
    common_instants,
    select,
)
from noninteract_ros.arrays import Array
from noninteract_ros.subtasks.layout import Layout

LAWS = ("energy_gated", "noninteracting", "paper")
GROWTH = 1e-8  # share of the peak at 1 kHz: what holding the torque over a tick can leave
PASSIVE = 1e-3  # share of the peak at 1 kHz by which (31) may be missed for the same reason
SAMPLED = 0.02  # share of the peak at 1 kHz: powers are sampled where the torque is fresh
JUMP = 1e-4  # [m; rad] a desired motion that leaves its own path by more has jumped
UNEXPLAINED = 0.2  # share of the work of holding the torque that its mean force may miss


@dataclass(frozen=True)
class Account:
    """The energy account of one subtask.

    Attributes:
        t: Time of the run, shape (n,) [s].
        storage: Shape (n,) [J].
        rate: Shape (n,) [W].
        supplied: Power from outside, shape (n,) [W].
        desired: Desired motion at the same instants.
        velocity_error: Shape (n, p) [m/s; rad/s].
        in_force: Whether nothing but the law gave torques, from each instant to the next, shape
            (n - 1,): no singularity and no limit of a joint.
    """

    t: Array
    storage: Array
    rate: Array
    supplied: Array
    desired: Motion
    velocity_error: Array
    in_force: NDArray[np.bool_]


def account(recorded: Recorded, subtask: str) -> Account:
    """The energy account of a subtask as the controller told it.

    Raises:
        RecordingError: A topic is missing or of another type.
    """
    series = recorded.run.labelled(f"{subtask}/energy")
    t = recorded.since_start(series.stamps)
    tracking = recorded.tracking(subtask)
    rows, others = common_instants(t, tracking.t)
    storage, rate, supplied = (series[key][rows] for key in ("storage", "rate", "supplied"))
    desired = select(tracking.desired, others)
    velocity_error = tracking.actual.velocity[others] - desired.velocity
    told = INTERVENTIONS in series.labels
    in_force = np.diff(series[INTERVENTIONS][rows] if told else np.zeros(len(rows))) == 0.0
    return Account(t[rows], storage, rate, supplied, desired, velocity_error, in_force)


def energy_metrics(
    recorded: Recorded, subtask: str, holding: Holding | None = None
) -> tuple[dict[str, Any], list[Check]]:
    """Sign, growth and consistency of one subtask's storage function.

    Args:
        recorded: The run.
        subtask: Name of the subtask.
        holding: Of a team without constant inertias, what holding the torque does to it. Its work
            bounds growth (31) and explains what the balance (33) misses.

    Raises:
        RecordingError: A topic is missing or of another type.
    """
    found = account(recorded, subtask)
    work = _holding_work(recorded, subtask, found, holding) if holding else np.zeros(len(found.t))
    peak = float(found.storage.max(initial=0.0))
    growth, growth_reason = _growth(recorded, subtask, found)
    excess, mismatch, blind = _against_supply(recorded, subtask, found, work)
    excess_reason = blind or _crossing(recorded)
    lowest = float(found.storage.min(initial=np.inf))
    held = float(np.abs(np.diff(work)).sum())
    metrics = {
        "storage_min_J": lowest,
        "storage_max_J": peak,
        "storage_final_J": float(found.storage[-1]),
        "growth_while_undisturbed_J": growth,
        "growth_reason": growth_reason or None,
        "rise_beyond_supply_J": None if blind else excess,
        "rate_mismatch_J": None if blind else mismatch,
        "rate_reason": blind or None,
        "work_of_holding_J": held if holding else None,
    }
    coarse = 1000.0 / recorded.rate
    # Where subtasks supply each other, what passes through one is not bounded by what it stores.
    passing = _largest_storage(recorded) if _crossing(recorded) else peak
    supplied = (1.0 + UNEXPLAINED) * held
    claims = (
        ("growth", growth or 0.0, GROWTH * peak * coarse**3 + supplied, growth_reason),
        ("passive", excess, PASSIVE * peak * coarse + supplied, excess_reason),
        ("rate", mismatch, SAMPLED * passing * coarse + UNEXPLAINED * held, blind),
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


def _largest_storage(recorded: Recorded) -> float:
    """Peak of the storage functions of all subtasks [J]."""
    series = [recorded.run.labelled(f"{name}/energy") for name in recorded.stack.names]
    return max(float(item["storage"].max(initial=0.0)) for item in series)


def _holding_work(recorded: Recorded, subtask: str, found: Account, holding: Holding) -> Array:
    """Work of holding the torque on a subtask since the first instant, shape (n,) [J]."""
    force = np.zeros_like(found.velocity_error)
    rows, others = common_instants(found.t, holding.t)
    force[rows] = holding.force[others][:, recorded.part(subtask)]
    return integral(found.t, (found.velocity_error * force).sum(axis=1))


def _crossing(recorded: Recorded) -> str:
    """Why a subtask's storage may grow at the cost of another's, or an empty text."""
    law = recorded.scenario.general.law
    if reason := _late(recorded):
        return reason
    return "" if law in LAWS else f"under law {law} other subtasks supply it too"


def _late(recorded: Recorded) -> str:
    """Why nobody knows what holding the torque does, or an empty text."""
    known = recorded.lockstep or recorded.constant
    return "" if known else "wall time: torques act late, on inertias that vary"


def _rubbing(recorded: Recorded) -> str:
    """Why the supply is not all told, or an empty text."""
    return FRICTION if recorded.team.friction.any() else ""


def _linked(recorded: Recorded, subtask: str) -> str:
    """Why changes of the reference's speed supply a subtask untold, or an empty text."""
    haptic = recorded.scenario.haptic
    over_link = recorded.scenario.link and haptic and haptic.subtask == subtask
    return "references over a link have no acceleration" if over_link else ""


def _growth(recorded: Recorded, subtask: str, found: Account) -> tuple[float | None, str]:
    """Largest growth over any time with a still reference and nothing that acts from outside."""
    if reason := _crossing(recorded) or _rubbing(recorded):
        return None, reason
    quiet = _still(found.desired) & _untouched(recorded, found.t) & found.in_force
    if not quiet.any():
        return None, "no time with a still reference and without external force"
    largest = 0.0
    for first, last in pieces(quiet):
        storage = found.storage[first : last + 1]
        lowest = np.minimum.accumulate(storage)
        largest = max(largest, float((storage - lowest).max()))
    return largest, ""


def _against_supply(
    recorded: Recorded, subtask: str, found: Account, work: Array
) -> tuple[float, float, str]:
    """Storage against integrated powers, over pieces without a jump of the reference.

    Where a person pushes a robot elsewhere than at its tool nobody has told the supply.

    Returns:
        Largest rise beyond what was supplied (31) [J], largest difference from the integrated
        rate (33) [J], and why neither can be told, or an empty text.
    """
    loaded = recorded.scenario.held is not None or recorded.scenario.pushes
    unseen = set(recorded.scenario.robots) - set(recorded.scenario.general.force_sensors)
    if loaded and unseen:
        return 0.0, 0.0, "the controller has no force sensors on every robot"
    if reason := _late(recorded) or _rubbing(recorded) or _linked(recorded, subtask):
        return 0.0, 0.0, reason
    excess = mismatch = 0.0
    told = ~jumps(recorded.task(subtask).layout, found.desired)
    told &= _felt(recorded, found.t) & found.in_force
    for first, last in pieces(told):
        piece = slice(first, last + 1)
        gain = found.storage[piece] - found.storage[first]
        unsupplied = gain - integral(found.t[piece], found.supplied[piece])
        excess = max(excess, float((unsupplied - np.minimum.accumulate(unsupplied)).max()))
        rest = gain - integral(found.t[piece], found.rate[piece]) - (work[piece] - work[first])
        mismatch = max(mismatch, float(np.abs(rest).max()))
    return excess, mismatch, ""


def integral(t: Array, power: Array) -> Array:
    """Energy since the first instant by the trapezoidal rule, shape (n,) [J]."""
    return np.concatenate(([0.0], np.cumsum(np.diff(t) * (power[1:] + power[:-1]) / 2)))


def _still(desired: Motion) -> NDArray[np.bool_]:
    """Whether the reference stands still from each instant to the next, shape (n - 1,)."""
    rest = (desired.velocity == 0.0).all(axis=1) & (desired.acceleration == 0.0).all(axis=1)
    same = (desired.position[1:] == desired.position[:-1]).all(axis=1)
    return np.asarray(rest[1:] & rest[:-1] & same)


def jumps(layout: Layout, desired: Motion) -> NDArray[np.bool_]:
    """Whether the reference jumps between each instant and the next, shape (n - 1,)."""
    h = np.diff(desired.t)[:, None]
    x, v, a = desired.position, desired.velocity, desired.acceleration
    way = layout.difference(x[1:], x[:-1])
    ahead = way - h * v[:-1] - 0.5 * h * h * a[:-1]
    back = way - h * v[1:] + 0.5 * h * h * a[1:]
    gap = np.minimum(np.abs(ahead), np.abs(back))
    # A jump in velocity alone shows as one in position only half as well.
    kick = np.abs(v[1:] - v[:-1] - 0.5 * h * (a[1:] + a[:-1]))
    return np.asarray(((gap > JUMP) | (h * kick > JUMP)).any(axis=1))


def _felt(recorded: Recorded, t: Array) -> NDArray[np.bool_]:
    """Whether tools feel all that pushes, from each instant to the next, shape (n - 1,)."""
    felt = np.ones(max(len(t) - 1, 0), dtype=bool)
    for push in recorded.scenario.pushes.values():
        if not push.on_tool(recorded.team):
            felt &= (t[1:] <= push.start) | (t[:-1] >= push.start + push.duration)
    return felt


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
    return np.asarray(free[1:] & free[:-1]) & _felt(recorded, t)


def pieces(holds: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last instant of each piece in which every step holds."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], holds, [False])).astype(int)))
    return [(first, last) for first, last in pairwise(edges.tolist()) if holds[first]]
