# SPDX-License-Identifier: Apache-2.0
"""The recording against rehearsals: the same run again, without a source, under another law."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.decoupling import DECOUPLING_LAWS
from noninteract_ros.reporting.checks.checks import Check, at_most, not_applicable
from noninteract_ros.reporting.metrics.holding import (
    Holding,
    deflection,
    holding_force,
    impedance_of,
    recorded_holding,
    told_rows,
)
from noninteract_ros.reporting.metrics.influences import Influence
from noninteract_ros.reporting.recording.recorded import FRICTION, Recorded
from noninteract_ros.reporting.rehearsed.rehearsals import (
    Joints,
    Variant,
    owned_subtasks,
    rehearse_all,
    starts,
)

# [m; rad] How far a source may move a subtask that is not its own. On inertias that vary with
# where the team is, holding the torque over a tick moves it by `holding.deflection` more.
MOVED = 1e-9
SAME = 1e-12  # [m, m/s; rad, rad/s] the same arithmetic on another processor may round differently
# (29) keeps a subtask on its reference whatever others do; how it comes back is another thing.
OFF = "a subtask is off its reference, and its inertia depends on where the others are"
WINDOW = 2.0  # [s] that rehearsals without a source go on after it has begun
SHORTEST = 2000  # ticks of a rehearsal for its own sake
BUDGET = 400_000  # coordinates times ticks that one rehearsal may take


@dataclass(frozen=True)
class Comparison:
    """What the rehearsals showed.

    Attributes:
        metrics: The sections `reproduction`, `noninteraction` and `comparison`.
        checks: Their checks.
    """

    metrics: dict[str, Any]
    checks: list[Check] = field(default_factory=list)


class Comparer:
    """Runs the rehearsals that a recording needs, once each.

    Args:
        recorded: The recording.
        outside: What acted on it that its scenario does not foresee.
        other_laws: Whether the scenario is rehearsed under other laws as well.
    """

    def __init__(
        self, recorded: Recorded, outside: list[Influence], other_laws: bool = True
    ) -> None:
        self._recorded, self._outside = recorded, outside
        self._law = recorded.scenario.general.law
        self._owned = owned_subtasks(recorded.scenario)
        self._laws = [self._law, *(_others(recorded, self._law) if other_laws else ())]
        last = int(recorded.ticks[-1]) + 1 if recorded.lockstep else _planned_ticks(recorded)
        self._whole = min(last, BUDGET // recorded.team.n)
        # What a source moves shows soon; rehearsals without it need not go on for longer.
        self._sides = {
            source: min(self._whole, round((start + WINDOW) * recorded.rate) + 1)
            for source, start in starts(recorded.scenario).items()
            if source in self._owned
        }
        self._longest = max(self._sides.values(), default=min(self._whole, SHORTEST))
        self._results: dict[Variant, Joints] = {}

    def compare(self) -> Comparison:
        """All of it."""
        self._rehearse()
        reproduction, check = self._reproduction()
        noninteraction, checks = self._noninteraction()
        metrics = {
            "reproduction": reproduction,
            "noninteraction": noninteraction,
            "comparison": self._crossings(),
        }
        return Comparison(metrics, [check, *checks])

    def _without(self, law: str, source: str) -> Variant:
        return Variant(law, human=source != "human", autonomy=source != "autonomy")

    def _rehearse(self) -> None:
        # The whole run serves the reproduction only.
        ticks = self._longest if self._incomparable("*") else self._whole
        jobs = [(Variant(self._law), ticks)]
        for law in self._laws:
            jobs += [(self._without(law, source), side) for source, side in self._sides.items()]
            if law != self._law and self._owned:
                jobs.append((Variant(law), self._longest))
        results = rehearse_all(self._recorded.scenario, jobs)
        self._results = {job[0]: result for job, result in zip(jobs, results, strict=True)}

    def _reproduction(self) -> tuple[dict[str, Any], Check]:
        """The nodes add nothing: the recorded joint states are those of a rehearsal."""
        name, recorded = "reproduction", self._recorded
        reason = self._incomparable("*")
        units = sorted(set(recorded.team.units))
        unit = ", ".join([*units, *(f"{unit}/s" for unit in units)])
        if reason:
            return {"reason": reason}, not_applicable(name, SAME, unit, reason)
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
        return metrics, at_most(name, largest, SAME, unit)

    def _noninteraction(self) -> tuple[dict[str, Any], list[Check]]:
        """Each source moves no subtask but its own."""
        metrics: dict[str, Any] = {}
        checks = []
        for source, owned in self._owned.items():
            without = self._results[self._without(self._law, source)]
            others = np.ones(self._recorded.team.n, dtype=bool)
            others[self._recorded.part(owned)] = False
            seconds = self._seconds(len(without.q))
            reason, moved, limits = self._moved_against(without, owned, others)
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
                checks.append(not_applicable(name, MOVED, ", ".join(units), reason))
                continue
            worst = int(np.argmax(np.where(others, moved / limits, -1.0)))
            unit = self._units[worst]
            checks.append(at_most(name, moved[worst], float(limits[worst]), unit))
        return metrics, checks

    def _moved_against(
        self, without: Joints, owned: str, others: NDArray[np.bool_]
    ) -> tuple[str, Array, Array]:
        """Why nothing can be told, or ""; how far coordinates moved, and how far they may."""
        nothing = np.zeros(self._recorded.team.n)
        if self._law not in DECOUPLING_LAWS:
            return f"law {self._law} lets motions cross over", nothing, nothing
        alone_in_it = "" if others.any() else "there is no other subtask"
        if reason := self._incomparable(owned) or self._carried_over(without) or alone_in_it:
            return reason, nothing, nothing
        difference, alone = self._held_apart(without)
        off = np.abs(without.error).max(axis=0) > MOVED + alone
        if not self._recorded.constant and (off & others).any():
            return OFF, nothing, nothing
        return "", self._moved_by(without), MOVED + difference

    @property
    def _units(self) -> tuple[str, ...]:
        """Unit of each coordinate of all subtasks, shape (n,)."""
        return tuple(unit for task in self._recorded.stack.subtasks for unit in task.units)

    def _carried_over(self, without: Joints) -> str:
        """Why subtasks move each other whatever the law does, or an empty text."""
        scenario = self._recorded.scenario
        if scenario.surroundings:
            return f"{', '.join(scenario.surroundings)} carries motions over"
        if scenario.pushes and not self._recorded.constant:
            return "what a push does depends on where the team is"
        if self._recorded.team.friction.any():
            return FRICTION
        if ticks := self._recorded.interventions(self._seconds(len(without.q))):
            return (
                f"singularities, limits of joints or energy changed the torques of {ticks} ticks"
            )
        return ""

    def _held_apart(self, without: Joints) -> tuple[Array, Array]:
        """What holding the torque can do, shape (n,) each.

        How far it can lead the recording and a rehearsal apart, and the rehearsal itself away
        from its references.
        """
        recorded = self._recorded
        if recorded.constant:
            return np.zeros(recorded.team.n), np.zeros(recorded.team.n)
        rows = told_rows(recorded, min(len(without.q), len(recorded.ticks)))
        rows = rows[recorded.ticks[rows] < len(without.q)]
        ticks = recorded.ticks[rows]
        force = self._holding.force[: len(rows)]
        changes = np.zeros_like(without.v)
        changes[1:-1] = np.diff(without.torque[1:], axis=0)
        alone = holding_force(recorded, without.q[ticks], without.v[ticks], changes[ticks])
        impedance, seconds = impedance_of(recorded), self._seconds(len(without.q))
        return (
            deflection(impedance, force - alone, seconds),
            deflection(impedance, alone, seconds),
        )

    @cached_property
    def _holding(self) -> Holding:
        return recorded_holding(self._recorded)

    def _crossings(self) -> dict[str, Any]:
        """How far each source moves each subtask, by law, in rehearsals."""
        laws: dict[str, Any] = {}
        for law in self._laws:
            full = self._results[Variant(law)] if self._owned else None
            laws[law] = {
                source: self._moved(full, self._results[self._without(law, source)])
                for source in self._owned
                if full is not None
            }
        return {
            "compared_s": {source: self._seconds(ticks) for source, ticks in self._sides.items()},
            "led_by": dict(self._owned),
            "moved": laws,
            "note": "paper is the same law as noninteracting on constant inertias"
            if self._recorded.constant
            else None,
        }

    def _seconds(self, ticks: int) -> float:
        return (ticks - 1) / self._recorded.rate

    def _moved_by(self, without: Joints) -> Array:
        """Largest distance of the recording from a rehearsal, shape (n,) [m; rad]."""
        recorded = self._recorded
        rows = recorded.ticks < len(without.q)
        ticks = recorded.ticks[rows]
        values = recorded.task_values(without.q[ticks], without.v[ticks])[0]
        return self._apart(recorded.values[0][rows], values)

    def _moved(self, a: Joints, b: Joints) -> dict[str, dict[str, float]]:
        """Largest distance between two runs in each subtask, while both last [m; rad]."""
        count = min(len(a.q), len(b.q))
        values = [self._recorded.task_values(run.q[:count], run.v[:count])[0] for run in (a, b)]
        return self._by_subtask(self._apart(*values))

    def _apart(self, a: Array, b: Array) -> Array:
        """Largest error of values a towards values b, both of shape (m, size), shape (n,)."""
        apart = np.abs(self._recorded.stack.difference(a, b)).max(axis=0, initial=0.0)
        return np.where(np.isfinite(apart), apart, np.inf)

    def _by_subtask(self, numbers: Array) -> dict[str, dict[str, float]]:
        """Largest of each subtask's numbers by unit, of shape (n,)."""
        stack, units = self._recorded.stack, np.array(self._units)
        found: dict[str, dict[str, float]] = {}
        for name, part in zip(stack.names, stack.slices, strict=True):
            own, numbers_of = units[part], numbers[part]
            found[name] = {
                unit: float(numbers_of[own == unit].max()) for unit in dict.fromkeys(own.tolist())
            }
        return found

    def _incomparable(self, ignored: str) -> str:
        """Why the recording is not what its scenario alone gives, inputs to one subtask aside."""
        if not self._recorded.lockstep:
            return "wall time: every run is another one"
        texts = [item.text for item in self._outside if item.subtask != ignored]
        return f"not in the scenario: {'; '.join(texts)}" if texts else ""


def _others(recorded: Recorded, law: str) -> list[str]:
    """Laws to compare with; what `energy_gated` is with open gates would tell nothing new."""
    laws = ["noninteracting", "natural"] + ([] if recorded.constant else ["paper"])
    alike = law == "energy_gated" or (recorded.constant and law == "paper")
    same = {law, "noninteracting"} if alike else {law}
    return [name for name in laws if name not in same]


def _planned_ticks(recorded: Recorded) -> int:
    return round(recorded.scenario.general.duration * recorded.rate) + 1


def _largest(values: Array) -> float:
    """Largest magnitude; infinite where something is not a number."""
    if not values.size:
        return 0.0
    largest = float(np.abs(values).max())
    return largest if np.isfinite(largest) else float("inf")
