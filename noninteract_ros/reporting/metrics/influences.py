# SPDX-License-Identifier: Apache-2.0
"""What acted on a run that its scenario does not foresee."""

from dataclasses import dataclass

import numpy as np

from noninteract_ros.clock import seconds, stamp
from noninteract_ros.control.law.decoupling import LAWS
from noninteract_ros.control.references.inputs import SOURCES
from noninteract_ros.reporting.metrics.intervals import laws
from noninteract_ros.reporting.recording.recorded import Recorded
from noninteract_ros.sources.announcements import Sampler

FIRST_START = "the first state"  # What the controller says of a start that every run has.
INPUTS = ("target_pose", "target_twist", "wrench")
# Kinds of influences that the desired motion tells of, or the transitions that are counted.
MOTION, CHANGE = "motion", "change"
OTHER = "other"


@dataclass(frozen=True)
class Influence:
    """Something from outside.

    Attributes:
        subtask: Subtask whose input it is; empty where it acts on the team or the controller.
        text: What it was.
        kind: `MOTION` where all of it shows in what the subtask is asked to do, `CHANGE` where it
            is counted while it lasts, or `OTHER`.
    """

    subtask: str
    text: str
    kind: str = OTHER


def influences(recorded: Recorded) -> list[Influence]:
    """Inputs, pushes and changes at run time that the scenario does not hold."""
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
                found += _unforeseen(recorded, subtask, source, samplers.get((subtask, source)))
    return found + _changes(recorded)


def _unforeseen(
    recorded: Recorded, subtask: str, source: str, sampler: Sampler | None
) -> list[Influence]:
    """References that the scenario's own source does not give."""
    topic = f"{subtask}/{source}/reference"
    if sampler is None:
        return [Influence(subtask, f"references on {topic}", MOTION)]
    series = recorded.run.trajectory(topic)
    found = []
    # A source that saw a state twice says again what it has said; that changes nothing.
    if len(series.contradicted):
        text = f"different references for the same instant on {topic}"
        found.append(Influence(subtask, text, MOTION))
    if not len(series.stamps) or not recorded.lockstep:
        return found  # In wall time a source counts from when it was started.
    foreseen, following = set(), -0.5 / recorded.rate
    last = seconds(stamp(series.stamps.max()))
    while (following := sampler.next_sample(following)) <= last:
        foreseen.add(stamp(following))
    stamps = np.round(series.stamps * 1e9).astype(np.int64).tolist()
    if not foreseen.issuperset(stamps):
        found.append(Influence(subtask, f"references at other instants on {topic}", MOTION))
    return found


def _changes(recorded: Recorded) -> list[Influence]:
    """Changes of law and authority, stops and new starts, as far as the controller told."""
    own = recorded.scenario.general.law
    told = {str(law) for law in laws(recorded, recorded.t)} - {own}
    texts = {f"law changed to {law}": None for law in LAWS if law in told}
    changed: dict[str, None] = {}  # The controller tells of all that were changed so far.
    for status in recorded.run.diagnostics() if recorded.has("diagnostics") else ():
        if not status["name"].endswith("controller"):
            continue
        values = status["values"]
        if (law := values.get("law", own)) != own:
            texts[f"law changed to {law}"] = None
        start = values.get("last start", "none")
        if start not in ("none", FIRST_START):
            texts[f"the controller started anew: {start}"] = None
        if (names := values.get("changed parameters", "none")) != "none":
            changed |= dict.fromkeys(names.split(", "))
        if status["message"] == "stopped":
            texts["the controller was stopped"] = None
        for name, spec in recorded.scenario.subtasks.items():
            led_by = values.get(f"{name} led by", spec.input.authority).split(",")[0]
            if led_by not in (spec.input.authority, *spec.input.hand_over_to):
                texts[f"authority over {name} changed to {led_by}"] = None
    counts = recorded.told(recorded.stack.names[0], "transitions")
    if not texts and not changed and counts is not None and np.ptp(counts[1]) > 0.0:
        # Too short for a diagnosis in between to tell of it.
        texts["a stop, a change of law or gains, or a new start"] = None
    found = [Influence("", text, CHANGE) for text in texts]
    if changed:
        told_of = all(name == "law" or name.endswith(".authority") for name in changed)
        text = f"parameters were changed: {', '.join(changed)}"
        found.append(Influence("", text, CHANGE if told_of else OTHER))
    return found
