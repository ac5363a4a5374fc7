# SPDX-License-Identifier: Apache-2.0
"""Autonomous planner of the relative subtask: formations and the transitions between them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import InputError, ScenarioError
from noninteract_ros.schema import join, key
from noninteract_ros.sources.minimum_jerk import RestToRest
from noninteract_ros.sources.schedule import TOLERANCE, Schedule
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference


@dataclass(frozen=True)
class PlannerSettings:
    """Block `planner` of a scenario; each formation has a block of its own inside it."""

    subtask: str = key("Subtask that the planner commands", "relative")
    update_rate: float = key("Rate of its references [Hz]", 100.0, positive=True)
    formations: tuple[str, ...] = key("Names of the formations in order of time", ())


@dataclass(frozen=True)
class Formation:
    """Value of the relative subtask and the time of its transition."""

    value: tuple[float, ...] = key(
        "Value of the subtask, element after element [m], each with its quaternion x, y, z, w"
    )
    time: float = key("Start time of the transition to it [s]", 0.0, minimum=0.0)
    duration: float = key("Duration of the transition [s]; 0 for the first one", 0.0, minimum=0.0)


class FormationPlanner:
    """Sequence of formations with minimum-jerk transitions.

    Times count from the start of the run.

    Args:
        settings: Names and order of the formations.
        formations: Formation of each name.
        layout: Layout of the commanded subtask's values.
        path: Dotted key of the block, for error messages.

    Raises:
        ScenarioError: No formation is listed, or one has no block, the wrong size, an invalid
            quaternion, a time out of order or inside the transition before it, or no duration
            although it is not the first.
    """

    def __init__(
        self,
        settings: PlannerSettings,
        formations: Mapping[str, Formation],
        layout: Layout,
        path: str = "planner",
    ) -> None:
        if not settings.formations:
            raise ScenarioError(join(path, "formations"), "an empty list", "1 or more names")
        for name in settings.formations:
            if name not in formations:
                raise ScenarioError(join(path, name), "nothing", "a formation (required)")
        blocks = [formations[name] for name in settings.formations]
        paths = [join(path, name) for name in settings.formations]
        _check_times(paths, blocks)
        self._start = blocks[0].time
        self._motion = RestToRest(
            [block.time for block in blocks[1:]],
            [block.duration for block in blocks[1:]],
            [_value(*item, layout) for item in zip(paths, blocks, strict=True)],
            layout,
        )
        self._schedule = Schedule(settings.update_rate, [(self._start, math.inf)])

    def sample(self, t: float, feedback: Array | None = None) -> Reference | None:
        """Return the planned motion at time `t` [s]; None before the first formation.

        The feedback has no effect on a planner; the argument belongs to the interface `Sampler`.
        """
        if t < self._start - TOLERANCE / self._schedule.rate:
            return None
        return self._motion(t)

    def next_update(self, t: float) -> float:
        """Return the first update instant after `t` [s], with or without a reference."""
        return self._schedule.next_update(t)

    def next_sample(self, t: float) -> float:
        """Return the first update instant after `t` with a reference [s]."""
        return self._schedule.next_sample(t)


def _value(path: str, block: Formation, layout: Layout) -> Array:
    found = list(block.value)
    if len(found) != layout.size:
        turns = ", four of them for each rotation" if layout.rotates else ", one per coordinate"
        raise ScenarioError(join(path, "value"), found, f"{layout.size} numbers{turns}")
    try:
        return layout.checked(np.array(found))
    except InputError as error:
        allowed = f"unit quaternions x, y, z, w ({error})"
        raise ScenarioError(join(path, "value"), found, allowed) from error


def _check_times(paths: Sequence[str], blocks: Sequence[Formation]) -> None:
    if blocks[0].duration > 0.0:
        allowed = "0 for the first formation: there is none to change from"
        raise ScenarioError(join(paths[0], "duration"), blocks[0].duration, allowed)
    for path, (before, block) in zip(paths[1:], pairwise(blocks), strict=True):
        if block.duration == 0.0:
            allowed = "> 0 for every formation but the first"
            raise ScenarioError(join(path, "duration"), block.duration, allowed)
        earliest = before.time + before.duration
        if block.time < earliest:
            allowed = f">= {earliest:g}, when the formation before it is reached"
            raise ScenarioError(join(path, "time"), block.time, allowed)
