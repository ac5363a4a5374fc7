# SPDX-License-Identifier: Apache-2.0
"""External influences on a run that are not part of its scenario."""

from dataclasses import dataclass

import numpy as np

from noninteract_ros.clock import seconds, stamp
from noninteract_ros.control.law.decoupling import LAWS
from noninteract_ros.control.references.inputs import SOURCES
from noninteract_ros.reporting.metrics.intervals import laws
from noninteract_ros.reporting.recording.recorded import Recorded
from noninteract_ros.sources.announcements import Sampler

FIRST_START = "the first state"  # reported by the controller at the start of every run
INPUTS = ("target_pose", "target_twist", "wrench")
# Kinds of influences: visible in the desired motion, or counted as transitions.
MOTION, CHANGE = "motion", "change"
OTHER = "other"


@dataclass(frozen=True)
class Influence:
    """External influence on a run.

    Attributes:
        subtask: Subtask that receives the input; empty for inputs of the team or the controller.
        text: Description.
        kind: `MOTION` if fully contained in the desired motion, `CHANGE` if counted as a
            transition while it lasts, else `OTHER`.
    """

    subtask: str
    text: str
    kind: str = OTHER


def influences(recorded: Recorded) -> list[Influence]:
    """Return inputs, pushes and changes at run time that are not part of the scenario."""
    scenario = recorded.scenario
    found = [
        Influence("", f"pushes on {name}/push") for name in scenario.robots
        if recorded.has(f"{name}/push")
    ]  # fmt: skip
    samplers: dict[tuple[str, str], Sampler] = {}
    if scenario.haptic:
        key = scenario.haptic.subtask, "human"
        samplers[key] = scenario.build_haptic(recorded.stack)
    if scenario.planner:
        key = scenario.planner.subtask, "autonomy"
        samplers[key] = scenario.build_planner(recorded.stack)
    for subtask in scenario.subtasks:
        for source in SOURCES:
            prefix = f"{subtask}/{source}"
            found += [
                Influence(
                    subtask, f"input on {prefix}/{kind}", OTHER if kind == "wrench" else MOTION
                )
                for kind in INPUTS
                if recorded.has(f"{prefix}/{kind}")
            ]
            if recorded.has(f"{prefix}/reference"):
                found += _unexpected_references(
                    recorded, subtask, source, samplers.get((subtask, source))
                )
    return found + _changes(recorded)


def _unexpected_references(
    recorded: Recorded, subtask: str, source: str, sampler: Sampler | None
) -> list[Influence]:
    """Return references that the scenario's own source does not publish."""
    topic = f"{subtask}/{source}/reference"
    if sampler is None:
        return [Influence(subtask, f"references on {topic}", MOTION)]
    series = recorded.run.trajectory(topic)
    found = []
    # A source repeats its reference when it receives a state twice; that is no conflict.
    if len(series.conflicting):
        text = f"conflicting references with equal stamps on {topic}"
        found.append(Influence(subtask, text, MOTION))
    if not len(series.stamps) or not recorded.lockstep:
        return found  # In wall time sources count from their own start.
    expected, following = set(), -0.5 / recorded.rate
    last = seconds(stamp(series.stamps.max()))
    while (following := sampler.next_sample(following)) <= last:
        expected.add(stamp(following))
    stamps = np.round(series.stamps * 1e9).astype(np.int64).tolist()
    if not expected.issuperset(stamps):
        found.append(Influence(subtask, f"references with unexpected stamps on {topic}", MOTION))
    return found


def _changes(recorded: Recorded) -> list[Influence]:
    """Return changes of law, gains and authority, stops and restarts that were reported."""
    own = recorded.scenario.general.law
    in_force = {str(law) for law in laws(recorded, recorded.t)} - {own}
    texts = {f"law changed to {law}": None for law in LAWS if law in in_force}
    changed: dict[str, None] = {}  # The controller reports all parameters changed so far.
    for status in recorded.run.diagnostics() if recorded.has("diagnostics") else ():
        if not status["name"].endswith("controller"):
            continue
        values = status["values"]
        if (law := values.get("law", own)) != own:
            texts[f"law changed to {law}"] = None
        start = values.get("last start", "none")
        if start not in ("none", FIRST_START):
            texts[f"the controller restarted: {start}"] = None
        if (names := values.get("changed parameters", "none")) != "none":
            changed |= dict.fromkeys(names.split(", "))
        if status["message"].startswith("stopped"):
            texts["the controller was stopped"] = None
        for name, spec in recorded.scenario.subtasks.items():
            led_by = values.get(f"{name} led by", spec.input.authority).split(",")[0]
            if led_by not in (spec.input.authority, *spec.input.hand_over_to):
                texts[f"authority over {name} changed to {led_by}"] = None
    counts = recorded.energy_entry(recorded.stack.names[0], "transitions")
    if not texts and not changed and counts is not None and np.ptp(counts[1]) > 0.0:
        # Shorter than the period of the diagnostics.
        texts["a stop, a change of law or gains, or a restart"] = None
    found = [Influence("", text, CHANGE) for text in texts]
    if changed:
        traced = all(name == "law" or name.endswith(".authority") for name in changed)
        text = f"parameters changed: {', '.join(changed)}"
        found.append(Influence("", text, CHANGE if traced else OTHER))
    return found
