# SPDX-License-Identifier: Apache-2.0
"""Passivity checks on the storage functions (32) of a run and their rates (33).

Each check covers the intervals in which it can hold: only the law and gains in force determine the
torques, the team moves continuously and, except for (33), the law decouples.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.reporting.checks.checks import Check, at_least, at_most, not_applicable
from noninteract_ros.reporting.metrics import intervals
from noninteract_ros.reporting.metrics.intervals import segments
from noninteract_ros.reporting.metrics.zero_order_hold import HoldForce
from noninteract_ros.reporting.recording.recorded import (
    FRICTION,
    Recorded,
    RecordedMotion,
    common_times,
    select,
)

GROWTH = 1e-8  # allowed growth, share of the peak at 1 kHz, due to the zero-order hold
PASSIVE = 1e-3  # allowed violation of (31), share of the peak at 1 kHz, for the same reason
SAMPLED = 0.02  # allowed error of sampled powers, share of the peak at 1 kHz
UNEXPLAINED = 0.2  # relative error of the hold work, which uses the mean force
ROUNDING = 1e-18  # [J] storage of errors up to about 1e-12 m
NEVER = "the law alone never determined the torques"
DISTURBED = "no interval with a reference at rest and without external force"


@dataclass(frozen=True)
class StorageBalance:
    """Energy balance of one subtask.

    Attributes:
        t: Time of the run, shape (n,) [s].
        storage: Storage function, shape (n,) [J].
        rate: Rate of the storage function (33), shape (n,) [W].
        supplied: External power, shape (n,) [W].
        desired: Desired motion at the same times.
        velocity_error: Velocity error, shape (n, p) [m/s; rad/s].
        law: Law in force, shape (n,).
        in_force: True for intervals in which that law alone moved the team, without limits,
            transitions, stops or resets, shape (n - 1,).
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
    """Value of a check over the intervals in which it applies.

    Attributes:
        value: Largest value [J].
        limit: Limit of the value [J].
        reason: Reason why the check does not apply, or an empty text.
    """

    value: float
    limit: float
    reason: str = ""

    @property
    def metric(self) -> float | None:
        """Value for `metrics.json`; None if the check does not apply."""
        return None if self.reason else self.value


def storage_balance(recorded: Recorded, subtask: str) -> StorageBalance:
    """Return the energy balance of a subtask as published by the controller.

    Raises:
        RecordingError: A topic is missing or of another type.
    """
    series = recorded.run.labelled(f"{subtask}/energy")
    t = recorded.since_start(series.stamps)
    tracking = recorded.tracking(subtask)
    rows, others = common_times(t, tracking.t)
    storage, rate, supplied = (series[key][rows] for key in ("storage", "rate", "supplied"))
    desired = select(tracking.desired, others)
    velocity_error = tracking.actual.velocity[others] - desired.velocity
    in_force = intervals.by_law_alone(series, rows) & intervals.continuous_between(
        recorded, t[rows]
    )
    law = intervals.laws(recorded, t[rows])
    return StorageBalance(
        t=t[rows],
        storage=storage,
        rate=rate,
        supplied=supplied,
        desired=desired,
        velocity_error=velocity_error,
        law=law,
        in_force=in_force,
    )


def energy_metrics(
    recorded: Recorded, subtask: str, hold: HoldForce | None = None
) -> tuple[dict[str, Any], list[Check]]:
    """Return metrics and checks of sign, growth and consistency of a storage function.

    Args:
        recorded: The run.
        subtask: Name of the subtask.
        hold: Equivalent force of the zero-order hold, if known; its work counts as supply.

    Raises:
        RecordingError: A topic is missing or of another type.
    """
    found = storage_balance(recorded, subtask)
    work = _hold_work(recorded, subtask, found, hold) if hold else np.zeros(len(found.t))
    judge = _Judge(recorded, subtask, found, work)
    lowest = float(found.storage.min(initial=np.inf))
    claims = {"growth": judge.growth(), "passive": judge.excess(), "rate": judge.mismatch()}
    metrics = {
        "storage_min_J": lowest,
        "storage_max_J": float(found.storage.max(initial=0.0)),
        "storage_final_J": float(found.storage[-1]),
        "growth_while_undisturbed_J": claims["growth"].metric,
        "growth_reason": claims["growth"].reason or None,
        "rise_beyond_supply_J": claims["passive"].metric,
        "rise_reason": claims["passive"].reason or None,
        "rate_mismatch_J": claims["rate"].metric,
        "rate_reason": claims["rate"].reason or None,
        "judged_s": float(np.diff(found.t)[found.in_force].sum()),
        "hold_work_J": float(np.abs(np.diff(work)).sum()) if hold else None,
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
    """Checks of the storage function of one subtask.

    Args:
        recorded: The run.
        subtask: Name of the subtask.
        found: Energy balance of the subtask.
        work: Work of the hold force since the first time, shape (n,) [J].
    """

    def __init__(
        self, recorded: Recorded, subtask: str, found: StorageBalance, work: Array
    ) -> None:
        self._recorded, self._subtask = recorded, subtask
        self._found, self._work = found, work
        self._coarse = 1000.0 / recorded.rate
        self._decoupled = intervals.decoupling_in_force(found.law)
        jumped = intervals.reference_jumps(recorded.task(subtask).layout, found.desired)
        self._measurable = ~jumped & intervals.pushes_measured(recorded, found.t) & found.in_force

    def growth(self) -> JudgedInterval:
        """Return the largest growth with the reference at rest and no external force."""
        found, work, recorded = self._found, self._work, self._recorded
        quiet = intervals.reference_at_rest(found.desired) & intervals.undisturbed(
            recorded, found.t
        )
        where = quiet & found.in_force & self._decoupled

        def growth(segment: slice) -> float:
            return _rise(found.storage[segment] - work[segment])

        limit = max(GROWTH * self._peak(where) * self._coarse**3, self._unexplained(where))
        reason = self._coupling_reason() or _friction_reason(recorded)
        return _judge_segments(where, reason, DISTURBED, growth, limit)

    def excess(self) -> JudgedInterval:
        """Return the largest rise beyond the supplied energy (31) under decoupling laws."""
        found, work, where = self._found, self._work, self._measurable & self._decoupled

        def excess(segment: slice) -> float:
            supply = integral(found.t[segment], found.supplied[segment]) + work[segment]
            return _rise(found.storage[segment] - supply)

        limit = max(PASSIVE * self._peak(where) * self._coarse, self._unexplained(where))
        return _judge_segments(
            where, self._unknown_supply_reason() or self._coupling_reason(), NEVER, excess, limit
        )

    def mismatch(self) -> JudgedInterval:
        """Return the largest difference from the integrated rate (33), under any law.

        Coupled subtasks exchange energy that their own storage does not bound; the peak of all
        subtasks does.
        """
        found, work = self._found, self._work

        def mismatch(segment: slice) -> float:
            supply = integral(found.t[segment], found.rate[segment]) + work[segment]
            missed = found.storage[segment] - supply
            return float(np.abs(missed - missed[0]).max())

        apart, together = self._measurable & self._decoupled, self._measurable & ~self._decoupled
        judged = []
        for where, peak in (
            (apart, self._peak(apart)),
            (together, _largest_storage(self._recorded) if together.any() else 0.0),
        ):
            limit = max(SAMPLED * peak * self._coarse, self._unexplained(where))
            judged.append(
                _judge_segments(where, self._unknown_supply_reason(), NEVER, mismatch, limit)
            )
        return max(judged, key=lambda item: (not item.reason, item.value - item.limit))

    def _peak(self, where: NDArray[np.bool_]) -> float:
        """Return the largest storage at the ends of intervals [J]."""
        ends = np.concatenate((where, [False])) | np.concatenate(([False], where))
        return float(self._found.storage[ends[: len(self._found.t)]].max(initial=0.0))

    def _unexplained(self, where: NDArray[np.bool_]) -> float:
        """Return the error bound of the hold work over intervals [J]."""
        return UNEXPLAINED * float(np.abs(np.diff(self._work))[where].sum())

    def _coupling_reason(self) -> str:
        """Return the reason why other subtasks may supply this one, or an empty text."""
        if reason := _wall_time_reason(self._recorded):
            return reason
        if self._decoupled.any() or not len(self._found.law):
            return ""
        names = " and ".join(dict.fromkeys(self._found.law.tolist()))
        return f"coupled: under law {names} other subtasks supply it"

    def _unknown_supply_reason(self) -> str:
        """Return the reason why the supply is unknown, or an empty text."""
        recorded = self._recorded
        scenario = recorded.scenario
        pushed = any(recorded.has(f"{robot}/push") for robot in scenario.robots)
        loaded = scenario.held is not None or scenario.pushes or pushed
        if loaded and set(scenario.robots) - set(scenario.general.force_sensors):
            return "external forces unknown: not every robot has a force sensor"
        return (
            _wall_time_reason(recorded)
            or _friction_reason(recorded)
            or _link_reason(recorded, self._subtask)
        )


def _judge_segments(
    where: NDArray[np.bool_],
    reason: str,
    otherwise: str,
    measure: Callable[[slice], float],
    limit: float,
) -> JudgedInterval:
    """Return the largest value over all segments of the intervals `where`.

    Args:
        where: Intervals in which the check applies.
        reason: Reason why it does not apply at all, or an empty text.
        otherwise: Reason to report if there is no such interval.
        measure: Function of the rows of a segment.
        limit: Limit of the value [J].
    """
    limit += ROUNDING
    if reason or not where.any():
        return JudgedInterval(0.0, limit, reason or otherwise)
    return JudgedInterval(max(measure(slice(a, b + 1)) for a, b in segments(where)), limit)


def _rise(storage: Array) -> float:
    """Return the largest growth from any time to a later one [J]."""
    return float((storage - np.minimum.accumulate(storage)).max())


def _largest_storage(recorded: Recorded) -> float:
    """Return the peak of the storage functions of all subtasks [J]."""
    series = [recorded.run.labelled(f"{name}/energy") for name in recorded.stack.names]
    return max(float(item["storage"].max(initial=0.0)) for item in series)


def _hold_work(recorded: Recorded, subtask: str, found: StorageBalance, hold: HoldForce) -> Array:
    """Return the work of the hold force since the first time, shape (n,) [J]."""
    force = np.zeros_like(found.velocity_error)
    rows, others = common_times(found.t, hold.t)
    force[rows] = hold.force[others][:, recorded.part(subtask)]
    return integral(found.t, (found.velocity_error * force).sum(axis=1))


def _wall_time_reason(recorded: Recorded) -> str:
    """Return the reason why torques between states are unknown, or an empty text."""
    return "" if recorded.lockstep else "wall time: torques act late, ticks are not evenly spaced"


def _friction_reason(recorded: Recorded) -> str:
    """Return the reason why friction hides part of the supply, or an empty text."""
    return FRICTION if recorded.team.friction.any() else ""


def _link_reason(recorded: Recorded, subtask: str) -> str:
    """Return the reason why the reference accelerates unrecorded, or an empty text."""
    haptic = recorded.scenario.haptic
    over_link = recorded.scenario.link and haptic and haptic.subtask == subtask
    return "references over a link have no acceleration" if over_link else ""


def integral(t: Array, power: Array) -> Array:
    """Integrate a power by the trapezoidal rule since the first time, shape (n,) [J]."""
    return np.concatenate(([0.0], np.cumsum(np.diff(t) * (power[1:] + power[:-1]) / 2)))
