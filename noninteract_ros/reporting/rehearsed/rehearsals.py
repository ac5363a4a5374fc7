# SPDX-License-Identifier: Apache-2.0
"""Parallel rehearsals of variants of a recorded scenario."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.references.subtask_input import InputSettings
from noninteract_ros.reporting.rehearsed.processes import in_processes
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.rehearsal import Rehearsal

MIN_PARALLEL_TICKS = 6000  # smallest total number of ticks that is split into processes


@dataclass(frozen=True)
class Variant:
    """Variant of a scenario.

    Attributes:
        law: Law in force.
        human: True if the haptic device publishes.
        autonomy: True if the planner publishes.
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
        torque: Torque held until each tick, shape (ticks, n) [N or N m].
        error: Subtask errors at the previous tick, shape (ticks, n) [m; rad].
    """

    q: Array
    v: Array
    torque: Array
    error: Array


def rehearse_variant(scenario: Scenario, variant: Variant, ticks: int) -> Joints:
    """Rehearse a variant of a scenario, including the first state."""
    general = replace(scenario.general, law=variant.law)
    rehearsal = Rehearsal(replace(scenario, general=general), variant.human, variant.autonomy)
    simulation = rehearsal.simulation
    rows = [(rehearsal.q, simulation.v, simulation.torque, np.zeros(rehearsal.team.n))]
    for _ in range(ticks - 1):
        error = rehearsal.step().error.e
        rows.append((rehearsal.q, simulation.v, simulation.torque, error))
    return Joints(*(np.array(column) for column in zip(*rows, strict=True)))


def rehearse_all(scenario: Scenario, jobs: Sequence[tuple[Variant, int]]) -> list[Joints]:
    """Rehearse variants for a number of ticks each; long ones in parallel."""
    work = [(scenario, *job) for job in jobs]
    return in_processes(
        rehearse_variant, work, sum(ticks for _, ticks in jobs) >= MIN_PARALLEL_TICKS
    )


def source_starts(scenario: Scenario) -> dict[str, float]:
    """Return the time from which each source moves its subtask [s].

    For the planner at the latest the time at which all sources have started.
    """
    formations = [formation.time for formation in scenario.formations.values()] or [0.0]
    human = scenario.haptic.start_time if scenario.haptic else 0.0
    # The team usually starts in the first of several formations.
    changed = formations[:2][-1]
    found = {"human": human, "autonomy": min(changed, max(human, formations[0]))}
    for source, subtask in led_subtasks(scenario).items():
        found[source] = max(
            found[source], _takeover_time(scenario.subtasks[subtask].input, source)
        )
    return found


def _takeover_time(settings: InputSettings, source: str) -> float:
    """Return the time of the first planned hand-over to a source [s]; 0 if there is none."""
    if settings.authority == source:
        return 0.0
    plan = zip(settings.hand_over_times, settings.hand_over_to, strict=True)
    return min((time for time, taker in plan if taker == source), default=0.0)


def led_subtasks(scenario: Scenario) -> dict[str, str]:
    """Return the subtask that each source of the scenario leads."""
    owned = {}
    if scenario.haptic:
        owned["human"] = scenario.haptic.subtask
    if scenario.planner:
        owned["autonomy"] = scenario.planner.subtask
    return owned
