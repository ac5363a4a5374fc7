# SPDX-License-Identifier: Apache-2.0
"""Storage functions (32) of a run and their rates (33): what a passive subtask must show.

Each claim is judged over the intervals in which it can hold: where law and gains in force alone
made the torques, nobody put the team elsewhere and, but for (33), the law was one that decouples.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.reporting.checks.checks import Check, at_least, at_most, not_applicable
from noninteract_ros.reporting.metrics import intervals
from noninteract_ros.reporting.metrics.holding import Holding
from noninteract_ros.reporting.metrics.intervals import pieces
from noninteract_ros.reporting.recording.recorded import (
    FRICTION,
    Recorded,
    RecordedMotion,
    common_instants,
    select,
)

GROWTH = 1e-8  # share of the peak at 1 kHz: what holding the torque over a tick can leave
PASSIVE = 1e-3  # share of the peak at 1 kHz by which (31) may be missed for the same reason
SAMPLED = 0.02  # share of the peak at 1 kHz: powers are sampled where the torque is fresh
UNEXPLAINED = 0.2  # share of the work of holding the torque that its mean force may miss
ROUNDING = 1e-18  # [J] what errors of some 1e-12 m, and less, store
NEVER = "at no time did the law alone make the torques"
DISTURBED = "no time with a still reference and without external force"


@dataclass(frozen=True)
class StorageBalance:
    """The energy account of one subtask.

    Attributes:
        t: Time of the run, shape (n,) [s].
        storage: Shape (n,) [J].
        rate: Shape (n,) [W].
        supplied: Power from outside, shape (n,) [W].
        desired: Desired motion at the same instants.
        velocity_error: Shape (n, p) [m/s; rad/s].
        law: Law in force, shape (n,).
        in_force: Whether that law alone moved the team from each instant to the next, shape
            (n - 1,): no limit, no change that fades in, no stop, and nobody put it elsewhere.
    """

    t: Array
    storage: Array
    rate: Array
    supplied: Array
    desired: RecordedMotion
    velocity_error: Array
    law: NDArray[np.str_]
    in_force: NDArray[np.bool_]


@dataclass(frozen=True)
class JudgedInterval:
    """What a claim found, over the intervals in which it can hold.

    Attributes:
        value: The largest that was found [J].
        limit: What it may be [J].
        reason: Why there is nothing to judge, or an empty text.
    """

    value: float
    limit: float
    reason: str = ""

    @property
    def told(self) -> float | None:
        """The value; None where there is none."""
        return None if self.reason else self.value


def account(recorded: Recorded, subtask: str) -> StorageBalance:
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
    in_force = intervals.by_law_alone(series, rows) & intervals.without_jumps(recorded, t[rows])
    law = intervals.laws(recorded, t[rows])
    return StorageBalance(t[rows], storage, rate, supplied, desired, velocity_error, law, in_force)


def energy_metrics(
    recorded: Recorded, subtask: str, holding: Holding | None = None
) -> tuple[dict[str, Any], list[Check]]:
    """Sign, growth and consistency of one subtask's storage function.

    Args:
        recorded: The run.
        subtask: Name of the subtask.
        holding: What holding the torque over a tick does, where that is known; its work supplies
            the subtask as well.

    Raises:
        RecordingError: A topic is missing or of another type.
    """
    found = account(recorded, subtask)
    work = _holding_work(recorded, subtask, found, holding) if holding else np.zeros(len(found.t))
    judge = _Judge(recorded, subtask, found, work)
    lowest = float(found.storage.min(initial=np.inf))
    claims = {"growth": judge.growth(), "passive": judge.excess(), "rate": judge.mismatch()}
    metrics = {
        "storage_min_J": lowest,
        "storage_max_J": float(found.storage.max(initial=0.0)),
        "storage_final_J": float(found.storage[-1]),
        "growth_while_undisturbed_J": claims["growth"].told,
        "growth_reason": claims["growth"].reason or None,
        "rise_beyond_supply_J": claims["passive"].told,
        "rise_reason": claims["passive"].reason or None,
        "rate_mismatch_J": claims["rate"].told,
        "rate_reason": claims["rate"].reason or None,
        "judged_s": float(np.diff(found.t)[found.in_force].sum()),
        "work_of_holding_J": float(np.abs(np.diff(work)).sum()) if holding else None,
    }
    checks = [at_least(f"storage_positive.{subtask}", lowest, 0.0, "J")]
    for claim, item in claims.items():
        name = f"storage_{claim}.{subtask}"
        checks.append(
            not_applicable(name, item.limit, "J", item.reason)
            if item.reason
            else at_most(name, item.value, item.limit, "J")
        )
    return metrics, checks


class _Judge:
    """Judges the claims about one subtask.

    Args:
        recorded: The run.
        subtask: Name of the subtask.
        found: Its account.
        work: Work of holding the torque since the first instant, shape (n,) [J].
    """

    def __init__(
        self, recorded: Recorded, subtask: str, found: StorageBalance, work: Array
    ) -> None:
        self._recorded, self._subtask = recorded, subtask
        self._found, self._work = found, work
        self._coarse = 1000.0 / recorded.rate
        self._decoupled = intervals.decoupled(found.law)
        jumped = intervals.jumps(recorded.task(subtask).layout, found.desired)
        self._told = ~jumped & intervals.felt(recorded, found.t) & found.in_force

    def growth(self) -> JudgedInterval:
        """Largest growth over any time with a still reference and nothing that acts on it."""
        found, work, recorded = self._found, self._work, self._recorded
        quiet = intervals.still(found.desired) & intervals.untouched(recorded, found.t)
        where = quiet & found.in_force & self._decoupled

        def growth(piece: slice) -> float:
            return _rise(found.storage[piece] - work[piece])

        limit = max(GROWTH * self._peak(where) * self._coarse**3, self._unexplained(where))
        reason = self._crossing() or _rubbing(recorded)
        return _judged(where, reason, DISTURBED, growth, limit)

    def excess(self) -> JudgedInterval:
        """Largest rise beyond what was supplied (31), wherever the law decouples."""
        found, work, where = self._found, self._work, self._told & self._decoupled

        def excess(piece: slice) -> float:
            supply = integral(found.t[piece], found.supplied[piece]) + work[piece]
            return _rise(found.storage[piece] - supply)

        limit = max(PASSIVE * self._peak(where) * self._coarse, self._unexplained(where))
        return _judged(where, self._blind() or self._crossing(), NEVER, excess, limit)

    def mismatch(self) -> JudgedInterval:
        """Largest difference from the integrated rate (33), under any law.

        Where subtasks supply each other, what passes through one is not bounded by what it stores.
        """
        found, work = self._found, self._work

        def mismatch(piece: slice) -> float:
            supply = integral(found.t[piece], found.rate[piece]) + work[piece]
            missed = found.storage[piece] - supply
            return float(np.abs(missed - missed[0]).max())

        apart, together = self._told & self._decoupled, self._told & ~self._decoupled
        judged = []
        for where, peak in (
            (apart, self._peak(apart)),
            (together, _largest_storage(self._recorded) if together.any() else 0.0),
        ):
            limit = max(SAMPLED * peak * self._coarse, self._unexplained(where))
            judged.append(_judged(where, self._blind(), NEVER, mismatch, limit))
        return max(judged, key=lambda item: (not item.reason, item.value - item.limit))

    def _peak(self, where: NDArray[np.bool_]) -> float:
        """Largest storage at the ends of some intervals [J]."""
        ends = np.concatenate((where, [False])) | np.concatenate(([False], where))
        return float(self._found.storage[ends[: len(self._found.t)]].max(initial=0.0))

    def _unexplained(self, where: NDArray[np.bool_]) -> float:
        """What the work of holding the torque may be wrong by, over some intervals [J]."""
        return UNEXPLAINED * float(np.abs(np.diff(self._work))[where].sum())

    def _crossing(self) -> str:
        """Why the storage may grow at the cost of another subtask's, or an empty text."""
        if reason := _late(self._recorded):
            return reason
        if self._decoupled.any() or not len(self._found.law):
            return ""
        names = " and ".join(dict.fromkeys(self._found.law.tolist()))
        return f"under law {names} other subtasks supply it too"

    def _blind(self) -> str:
        """Why nobody told the supply, or an empty text."""
        recorded = self._recorded
        scenario = recorded.scenario
        pushed = any(recorded.has(f"{robot}/push") for robot in scenario.robots)
        loaded = scenario.held is not None or scenario.pushes or pushed
        if loaded and set(scenario.robots) - set(scenario.general.force_sensors):
            return "the controller has no force sensors on every robot"
        return _late(recorded) or _rubbing(recorded) or _linked(recorded, self._subtask)


def _judged(
    where: NDArray[np.bool_],
    reason: str,
    otherwise: str,
    measure: Callable[[slice], float],
    limit: float,
) -> JudgedInterval:
    """The largest over all pieces of a run in which a claim can hold.

    Args:
        where: Intervals in which it can.
        reason: Why it cannot be judged at all, or an empty text.
        otherwise: What to say where there is no such interval.
        measure: Takes the instants of a piece.
        limit: What it may be [J].
    """
    limit += ROUNDING
    if reason or not where.any():
        return JudgedInterval(0.0, limit, reason or otherwise)
    return JudgedInterval(max(measure(slice(a, b + 1)) for a, b in pieces(where)), limit)


def _rise(storage: Array) -> float:
    """Largest growth from any instant to a later one [J]."""
    return float((storage - np.minimum.accumulate(storage)).max())


def _largest_storage(recorded: Recorded) -> float:
    """Peak of the storage functions of all subtasks [J]."""
    series = [recorded.run.labelled(f"{name}/energy") for name in recorded.stack.names]
    return max(float(item["storage"].max(initial=0.0)) for item in series)


def _holding_work(
    recorded: Recorded, subtask: str, found: StorageBalance, holding: Holding
) -> Array:
    """Work of holding the torque on a subtask since the first instant, shape (n,) [J]."""
    force = np.zeros_like(found.velocity_error)
    rows, others = common_instants(found.t, holding.t)
    force[rows] = holding.force[others][:, recorded.part(subtask)]
    return integral(found.t, (found.velocity_error * force).sum(axis=1))


def _late(recorded: Recorded) -> str:
    """Why nobody knows what the torques did between the states, or an empty text."""
    return "" if recorded.lockstep else "wall time: torques act late, ticks are not evenly spaced"


def _rubbing(recorded: Recorded) -> str:
    """Why the supply is not all told, or an empty text."""
    return FRICTION if recorded.team.friction.any() else ""


def _linked(recorded: Recorded, subtask: str) -> str:
    """Why changes of the reference's speed supply a subtask untold, or an empty text."""
    haptic = recorded.scenario.haptic
    over_link = recorded.scenario.link and haptic and haptic.subtask == subtask
    return "references over a link have no acceleration" if over_link else ""


def integral(t: Array, power: Array) -> Array:
    """Energy since the first instant by the trapezoidal rule, shape (n,) [J]."""
    return np.concatenate(([0.0], np.cumsum(np.diff(t) * (power[1:] + power[:-1]) / 2)))
