# SPDX-License-Identifier: Apache-2.0
"""Rehearsals of a recorded scenario, to compare the recording with; several at a time."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.references.subtask_input import InputSettings
from noninteract_ros.reporting.rehearsed.processes import in_processes
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.rehearsal import Rehearsal

SMALL = 6000  # ticks in all that are not worth starting processes for


@dataclass(frozen=True)
class Variant:
    """One way to run the scenario.

    Attributes:
        law: Law in force.
        human: Whether the haptic device speaks.
        autonomy: Whether the planner speaks.
    """

    law: str
    human: bool = True
    autonomy: bool = True


@dataclass(frozen=True)
class Joints:
    """Joint states of a rehearsal, a row per tick.

    Attributes:
        q: Configuration, shape (ticks, nq).
        v: Velocity, shape (ticks, n).
        torque: Torque that was held until each tick, shape (ticks, n).
        error: Errors of all subtasks at the last tick before each, shape (ticks, n) [m; rad].
    """

    q: Array
    v: Array
    torque: Array
    error: Array


def rehearse_variant(scenario: Scenario, variant: Variant, ticks: int) -> Joints:
    """Rehearses a variant of a scenario, first state included."""
    general = replace(scenario.general, law=variant.law)
    rehearsal = Rehearsal(replace(scenario, general=general), variant.human, variant.autonomy)
    simulation = rehearsal.simulation
    rows = [(rehearsal.q, simulation.v, simulation.torque, np.zeros(rehearsal.team.n))]
    for _ in range(ticks - 1):
        error = rehearsal.step().error.e
        rows.append((rehearsal.q, simulation.v, simulation.torque, error))
    return Joints(*(np.array(column) for column in zip(*rows, strict=True)))


def rehearse_all(scenario: Scenario, jobs: Sequence[tuple[Variant, int]]) -> list[Joints]:
    """Rehearses variants for so many ticks each; long ones in processes of their own."""
    work = [(scenario, *job) for job in jobs]
    return in_processes(rehearse_variant, work, sum(ticks for _, ticks in jobs) >= SMALL)


def starts(scenario: Scenario) -> dict[str, float]:
    """When each source begins to move something, or when all have begun, if that is before [s]."""
    formations = [formation.time for formation in scenario.formations.values()] or [0.0]
    human = scenario.haptic.start_time if scenario.haptic else 0.0
    # Where there are several formations the team mostly starts in the first.
    changed = formations[:2][-1]
    found = {"human": human, "autonomy": min(changed, max(human, formations[0]))}
    for source, subtask in owned_subtasks(scenario).items():
        found[source] = max(found[source], _takes(scenario.subtasks[subtask].input, source))
    return found


def _takes(settings: InputSettings, source: str) -> float:
    """When a source first leads a subtask by plan [s]; 0 where that is not planned."""
    if settings.authority == source:
        return 0.0
    plan = zip(settings.hand_over_times, settings.hand_over_to, strict=True)
    return min((time for time, taker in plan if taker == source), default=0.0)


def owned_subtasks(scenario: Scenario) -> dict[str, str]:
    """Subtask that each source of the scenario leads."""
    owned = {}
    if scenario.haptic:
        owned["human"] = scenario.haptic.subtask
    if scenario.planner:
        owned["autonomy"] = scenario.planner.subtask
    return owned
