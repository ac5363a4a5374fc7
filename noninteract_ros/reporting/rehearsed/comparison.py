# SPDX-License-Identifier: Apache-2.0
"""Comparison with rehearsals: the same run, without one source, and under other laws."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.decoupling import DECOUPLING_LAWS
from noninteract_ros.reporting.checks.checks import Check, at_most, not_applicable
from noninteract_ros.reporting.metrics.influences import Influence
from noninteract_ros.reporting.metrics.zero_order_hold import (
    HoldForce,
    deflection,
    hold_force,
    impedance_of,
    recorded_hold_force,
    telemetry_rows,
)
from noninteract_ros.reporting.recording.recorded import FRICTION, Recorded
from noninteract_ros.reporting.rehearsed.rehearsals import (
    Joints,
    Variant,
    led_subtasks,
    rehearse_all,
    source_starts,
)

# [m; rad] Allowed motion of a subtask by another subtask's source. On configuration-dependent
# inertias the zero-order hold adds `zero_order_hold.deflection`.
TOLERANCE = 1e-9
REPRODUCTION_TOLERANCE = (
    1e-12  # [m, m/s; rad, rad/s] the same arithmetic on another processor may round differently
)
# (29) keeps a subtask on its reference; its return to the reference depends on its inertia.
OFF_REFERENCE = "a subtask is off its reference, and its inertia depends on where the others are"
WINDOW = 2.0  # [s] duration of rehearsals without a source after its start
MIN_TICKS = 2000  # ticks of rehearsals without sources
MAX_COORDINATE_TICKS = 400_000  # largest coordinates times ticks of one rehearsal


@dataclass(frozen=True)
class Comparison:
    """Results of the rehearsals.

    Attributes:
        metrics: Sections `reproduction`, `noninteraction` and `comparison`.
        checks: Checks of these sections.
    """

    metrics: dict[str, Any]
    checks: list[Check] = field(default_factory=list)


class Comparer:
    """Comparison of a recording with rehearsals, each run once.

    Args:
        recorded: The recording.
        external: External influences that are not part of the scenario.
        other_laws: True to rehearse the scenario under other laws as well.
    """

    def __init__(
        self, recorded: Recorded, external: list[Influence], other_laws: bool = True
    ) -> None:
        self._recorded, self._external = recorded, external
        self._law = recorded.scenario.general.law
        self._owned = led_subtasks(recorded.scenario)
        self._laws = [self._law, *(_others(recorded, self._law) if other_laws else ())]
        last = int(recorded.ticks[-1]) + 1 if recorded.lockstep else _planned_ticks(recorded)
        self._whole = min(last, MAX_COORDINATE_TICKS // recorded.team.n)
        # The effect of a source appears soon after its start.
        self._source_ticks = {
            source: min(self._whole, round((start + WINDOW) * recorded.rate) + 1)
            for source, start in source_starts(recorded.scenario).items()
            if source in self._owned
        }
        self._longest = max(self._source_ticks.values(), default=min(self._whole, MIN_TICKS))
        self._results: dict[Variant, Joints] = {}

    def compare(self) -> Comparison:
        """Run all rehearsals and return their metrics and checks."""
        self._rehearse()
        reproduction, check = self._reproduction()
        noninteraction, checks = self._noninteraction()
        metrics = {
            "reproduction": reproduction,
            "noninteraction": noninteraction,
            "comparison": self._cross_motion(),
        }
        return Comparison(metrics, [check, *checks])

    def _without(self, law: str, source: str) -> Variant:
        return Variant(law, human=source != "human", autonomy=source != "autonomy")

    def _rehearse(self) -> None:
        # Only the reproduction needs the whole run.
        ticks = self._longest if self._incomparable_reason("*") else self._whole
        jobs = [(Variant(self._law), ticks)]
        for law in self._laws:
            jobs += [
                (self._without(law, source), side) for source, side in self._source_ticks.items()
            ]
            if law != self._law and self._owned:
                jobs.append((Variant(law), self._longest))
        results = rehearse_all(self._recorded.scenario, jobs)
        self._results = {job[0]: result for job, result in zip(jobs, results, strict=True)}

    def _reproduction(self) -> tuple[dict[str, Any], Check]:
        """Check that the recorded joint states equal those of a rehearsal without ROS."""
        name, recorded = "reproduction", self._recorded
        reason = self._incomparable_reason("*")
        units = sorted(set(recorded.team.units))
        unit = ", ".join([*units, *(f"{unit}/s" for unit in units)])
        if reason:
            return {"reason": reason}, not_applicable(name, REPRODUCTION_TOLERANCE, unit, reason)
        joints = self._results[Variant(self._law)]
        rows = recorded.ticks < len(joints.q)
        ticks = recorded.ticks[rows]
        q, v = recorded.q[rows] - joints.q[ticks], recorded.v[rows] - joints.v[ticks]
        largest = max(_largest(q), _largest(v))
        metrics = {
            "compared_s": float(recorded.t[rows][-1]),
            "max_position_difference": _largest(q),
            "max_velocity_difference": _largest(v),
            "unit": unit,
            "bit_equal": largest == 0.0,
        }
        return metrics, at_most(name, largest, REPRODUCTION_TOLERANCE, unit)

    def _noninteraction(self) -> tuple[dict[str, Any], list[Check]]:
        """Check that each source moves only its own subtask."""
        metrics: dict[str, Any] = {}
        checks = []
        for source, owned in self._owned.items():
            without = self._results[self._without(self._law, source)]
            others = np.ones(self._recorded.team.n, dtype=bool)
            others[self._recorded.part(owned)] = False
            seconds = self._seconds(len(without.q))
            reason, moved, limits = self._compare_without(without, owned, others)
            if not reason and not moved[~others].max() > 0.0:
                reason = f"{source} did not move {owned} within {seconds:g} s"
            metrics[f"without_{source}"] = {
                "reason": reason or None,
                "compared_s": seconds,
                "moved": None if reason else self._by_subtask(moved),
                "allowed": None if reason else self._by_subtask(limits),
            }
            name = f"noninteraction.{source}"
            if reason:
                units = sorted(set(np.array(self._units)[others].tolist()))
                checks.append(not_applicable(name, TOLERANCE, ", ".join(units), reason))
                continue
            worst = int(np.argmax(np.where(others, moved / limits, -1.0)))
            unit = self._units[worst]
            checks.append(at_most(name, moved[worst], float(limits[worst]), unit))
        return metrics, checks

    def _compare_without(
        self, without: Joints, owned: str, others: NDArray[np.bool_]
    ) -> tuple[str, Array, Array]:
        """Return the reason why the check does not apply, motions and limits, shape (n,) each."""
        nothing = np.zeros(self._recorded.team.n)
        if self._law not in DECOUPLING_LAWS:
            return f"law {self._law} does not decouple", nothing, nothing
        alone_in_it = "" if others.any() else "there is no other subtask"
        if (
            reason := self._incomparable_reason(owned)
            or self._coupling_reason(without)
            or alone_in_it
        ):
            return reason, nothing, nothing
        difference, alone = self._hold_deflections(without)
        off = np.abs(without.error).max(axis=0) > TOLERANCE + alone
        if not self._recorded.constant and (off & others).any():
            return OFF_REFERENCE, nothing, nothing
        return "", self._moved_by(without), TOLERANCE + difference

    @property
    def _units(self) -> tuple[str, ...]:
        """Unit of each subtask coordinate, length n."""
        return tuple(unit for task in self._recorded.stack.subtasks for unit in task.units)

    def _coupling_reason(self, without: Joints) -> str:
        """Return the reason why subtasks are coupled under any law, or an empty text."""
        scenario = self._recorded.scenario
        if scenario.surroundings:
            return f"coupled by {', '.join(scenario.surroundings)}"
        if scenario.pushes and not self._recorded.constant:
            return "the effect of a push depends on the configuration"
        if self._recorded.team.friction.any():
            return FRICTION
        if ticks := self._recorded.interventions(self._seconds(len(without.q))):
            return (
                f"singularities, joint limits or energy gates changed the torque in {ticks} ticks"
            )
        return ""

    def _hold_deflections(self, without: Joints) -> tuple[Array, Array]:
        """Return largest deflections by the hold force, shape (n,) each [m; rad].

        The first is between recording and rehearsal, the second of the rehearsal from its
        references.
        """
        recorded = self._recorded
        if recorded.constant:
            return np.zeros(recorded.team.n), np.zeros(recorded.team.n)
        rows = telemetry_rows(recorded, min(len(without.q), len(recorded.ticks)))
        rows = rows[recorded.ticks[rows] < len(without.q)]
        ticks = recorded.ticks[rows]
        force = self._hold.force[: len(rows)]
        changes = np.zeros_like(without.v)
        changes[1:-1] = np.diff(without.torque[1:], axis=0)
        alone = hold_force(recorded, without.q[ticks], without.v[ticks], changes[ticks])
        impedance, seconds = impedance_of(recorded), self._seconds(len(without.q))
        return (
            deflection(impedance, force - alone, seconds),
            deflection(impedance, alone, seconds),
        )

    @cached_property
    def _hold(self) -> HoldForce:
        return recorded_hold_force(self._recorded)

    def _cross_motion(self) -> dict[str, Any]:
        """Return the motion of each subtask caused by each source, by law, in rehearsals."""
        laws: dict[str, Any] = {}
        for law in self._laws:
            full = self._results[Variant(law)] if self._owned else None
            laws[law] = {
                source: self._moved(full, self._results[self._without(law, source)])
                for source in self._owned
                if full is not None
            }
        return {
            "compared_s": {
                source: self._seconds(ticks) for source, ticks in self._source_ticks.items()
            },
            "led_by": dict(self._owned),
            "moved": laws,
            "note": "laws paper and noninteracting are equal on constant inertias"
            if self._recorded.constant
            else None,
        }

    def _seconds(self, ticks: int) -> float:
        return (ticks - 1) / self._recorded.rate

    def _moved_by(self, without: Joints) -> Array:
        """Return the largest distance of the recording from a rehearsal, shape (n,) [m; rad]."""
        recorded = self._recorded
        rows = recorded.ticks < len(without.q)
        ticks = recorded.ticks[rows]
        values = recorded.task_values(without.q[ticks], without.v[ticks])[0]
        return self._apart(recorded.values[0][rows], values)

    def _moved(self, a: Joints, b: Joints) -> dict[str, dict[str, float]]:
        """Return the largest distance between two rehearsals in each subtask [m; rad]."""
        count = min(len(a.q), len(b.q))
        values = [self._recorded.task_values(run.q[:count], run.v[:count])[0] for run in (a, b)]
        return self._by_subtask(self._apart(*values))

    def _apart(self, a: Array, b: Array) -> Array:
        """Return the largest difference of values a and b, both (m, size), shape (n,)."""
        apart = np.abs(self._recorded.stack.difference(a, b)).max(axis=0, initial=0.0)
        return np.where(np.isfinite(apart), apart, np.inf)

    def _by_subtask(self, numbers: Array) -> dict[str, dict[str, float]]:
        """Return the largest of the numbers (n,) of each subtask by unit."""
        stack, units = self._recorded.stack, np.array(self._units)
        found: dict[str, dict[str, float]] = {}
        for name, part in zip(stack.names, stack.slices, strict=True):
            own, numbers_of = units[part], numbers[part]
            found[name] = {
                unit: float(numbers_of[own == unit].max()) for unit in dict.fromkeys(own.tolist())
            }
        return found

    def _incomparable_reason(self, ignored: str) -> str:
        """Return the reason why the run differs from its scenario, one subtask's inputs aside."""
        if not self._recorded.lockstep:
            return "wall time: runs are not reproducible"
        texts = [item.text for item in self._external if item.subtask != ignored]
        return f"external influence: {'; '.join(texts)}" if texts else ""


def _others(recorded: Recorded, law: str) -> list[str]:
    """Return laws to compare with, except laws equal to the own one with open gates."""
    laws = ["noninteracting", "natural"] + ([] if recorded.constant else ["paper"])
    alike = law == "energy_gated" or (recorded.constant and law == "paper")
    same = {law, "noninteracting"} if alike else {law}
    return [name for name in laws if name not in same]


def _planned_ticks(recorded: Recorded) -> int:
    return round(recorded.scenario.general.duration * recorded.rate) + 1


def _largest(values: Array) -> float:
    """Return the largest magnitude; infinity if any value is NaN."""
    if not values.size:
        return 0.0
    largest = float(np.abs(values).max())
    return largest if np.isfinite(largest) else float("inf")
