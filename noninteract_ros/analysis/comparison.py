# SPDX-License-Identifier: Apache-2.0
"""The recording against rehearsals: the same run again, without a source, under another law."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from noninteract_ros.analysis.checks import Check, at_most, not_applicable
from noninteract_ros.analysis.influences import Influence
from noninteract_ros.analysis.recorded import Recorded
from noninteract_ros.analysis.rehearsals import Joints, Variant, rehearse_all
from noninteract_ros.arrays import Array

MOVED = 1e-9  # [m] how far a source may move a subtask that is not its own
SAME = 1e-12  # [m, m/s] the same arithmetic on another processor may round differently
DECOUPLING_LAWS = ("noninteracting", "paper")
WINDOW = 2.0  # [s] that side runs go on after the last source has begun
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
        self._owned = _owned_subtasks(recorded)
        self._laws = [self._law, *(_others(recorded, self._law) if other_laws else ())]
        last = int(recorded.ticks[-1]) + 1 if recorded.lockstep else _planned_ticks(recorded)
        self._whole = min(last, BUDGET // recorded.team.n)
        self._side = min(self._whole, self._side_ticks())
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

    def _side_ticks(self) -> int:
        scenario = self._recorded.scenario
        starts = [0.0]
        if scenario.haptic:
            starts.append(scenario.haptic.start_time)
        starts += [formation.time for formation in scenario.formations.values()][:1]
        return round((max(starts) + WINDOW) * self._recorded.rate) + 1

    def _without(self, law: str, source: str) -> Variant:
        return Variant(law, human=source != "human", autonomy=source != "autonomy")

    def _rehearse(self) -> None:
        # The whole run serves the reproduction only.
        ticks = self._side if self._incomparable("*") else self._whole
        jobs = [(Variant(self._law), ticks)]
        for law in self._laws:
            jobs += [(self._without(law, source), self._side) for source in self._owned]
            if law != self._law and self._owned:
                jobs.append((Variant(law), self._side))
        results = rehearse_all(self._recorded.scenario, jobs)
        self._results = {job[0]: result for job, result in zip(jobs, results, strict=True)}

    def _reproduction(self) -> tuple[dict[str, Any], Check]:
        """The nodes add nothing: the recorded joint states are those of a rehearsal."""
        name, recorded = "reproduction", self._recorded
        reason = self._incomparable("*")
        if reason:
            return {"reason": reason}, not_applicable(name, SAME, "m, m/s", reason)
        joints = self._results[Variant(self._law)]
        rows = recorded.ticks < len(joints.q)
        ticks = recorded.ticks[rows]
        q, v = recorded.q[rows] - joints.q[ticks], recorded.v[rows] - joints.v[ticks]
        largest = max(_largest(q), _largest(v))
        metrics = {
            "compared_s": float(recorded.t[rows][-1]),
            "max_position_difference_m": _largest(q),
            "max_velocity_difference_m_per_s": _largest(v),
            "bit_equal": largest == 0.0,
        }
        return metrics, at_most(name, largest, SAME, "m, m/s")

    def _noninteraction(self) -> tuple[dict[str, Any], list[Check]]:
        """Each source moves no subtask but its own."""
        metrics: dict[str, Any] = {}
        checks = []
        for source, owned in self._owned.items():
            name = f"noninteraction.{source}"
            reason = self._incomparable(owned)
            if self._law not in DECOUPLING_LAWS:
                reason = f"law {self._law} lets motions cross over"
            without = self._results[self._without(self._law, source)]
            moved = {} if reason else self._moved_by(without)
            if not reason and not moved[owned] > 0.0:
                reason = f"{source} did not move {owned} within {self._side_s:g} s"
            others = [value for subtask, value in moved.items() if subtask != owned]
            if not reason and not others:
                reason = "there is no other subtask"
            metrics[f"without_{source}"] = {
                "reason": reason or None,
                "compared_s": self._side_s,
                "moved_m": None if reason else moved,
            }
            checks.append(
                not_applicable(name, MOVED, "m", reason)
                if reason
                else at_most(name, _largest(np.array(others)), MOVED, "m")
            )
        return metrics, checks

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
            "compared_s": self._side_s,
            "led_by": dict(self._owned),
            "moved_m": laws,
            "note": "paper is the same law as noninteracting on constant inertias"
            if self._recorded.constant
            else None,
        }

    @property
    def _side_s(self) -> float:
        return (self._side - 1) / self._recorded.rate

    def _moved_by(self, without: Joints) -> dict[str, float]:
        """Largest distance of the recording from a rehearsal in each subtask [m]."""
        recorded = self._recorded
        rows = recorded.ticks < len(without.q)
        ticks = recorded.ticks[rows]
        same_ticks = Joints(without.q[ticks], without.v[ticks])
        return self._moved(Joints(recorded.q[rows], recorded.v[rows]), same_ticks)

    def _moved(self, a: Joints, b: Joints) -> dict[str, float]:
        """Largest distance between two runs in each subtask, while both last [m]."""
        count = min(len(a.q), len(b.q))
        values = [self._recorded.task_values(run.q[:count], run.v[:count])[0] for run in (a, b)]
        names, slices = self._recorded.stack.names, self._recorded.stack.value_slices
        return {
            name: _largest((values[0] - values[1])[:, part])
            for name, part in zip(names, slices, strict=True)
        }

    def _incomparable(self, ignored: str) -> str:
        """Why the recording is not what its scenario alone gives, inputs to one subtask aside."""
        if not self._recorded.lockstep:
            return "wall time: every run is another one"
        texts = [item.text for item in self._outside if item.subtask != ignored]
        return f"not in the scenario: {'; '.join(texts)}" if texts else ""


def _owned_subtasks(recorded: Recorded) -> dict[str, str]:
    """Subtask that each source of the scenario leads."""
    scenario = recorded.scenario
    owned = {}
    if scenario.haptic:
        owned["human"] = scenario.haptic.subtask
    if scenario.planner:
        owned["autonomy"] = scenario.planner.subtask
    return owned


def _others(recorded: Recorded, law: str) -> list[str]:
    """Laws to compare with; on constant inertias `paper` is `noninteracting`."""
    laws = ["noninteracting", "natural"] + ([] if recorded.constant else ["paper"])
    same = {law, "noninteracting"} if recorded.constant and law == "paper" else {law}
    return [name for name in laws if name not in same]


def _planned_ticks(recorded: Recorded) -> int:
    return round(recorded.scenario.general.duration * recorded.rate) + 1


def _largest(values: Array) -> float:
    """Largest magnitude; infinite where something is not a number."""
    if not values.size:
        return 0.0
    largest = float(np.abs(values).max())
    return largest if np.isfinite(largest) else float("inf")
