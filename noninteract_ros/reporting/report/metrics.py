# SPDX-License-Identifier: Apache-2.0
"""All metrics and checks of a recorded run."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import RecordingError
from noninteract_ros.reporting.checks.checks import Check, at_most, not_applicable
from noninteract_ros.reporting.metrics.closed_form import (
    NotApplicableError,
    closed_form,
    closed_form_check,
)
from noninteract_ros.reporting.metrics.influences import Influence, influences
from noninteract_ros.reporting.metrics.link_metrics import link_metrics
from noninteract_ros.reporting.metrics.passivity_observer import passivity_metrics
from noninteract_ros.reporting.metrics.storage_functions import energy_metrics
from noninteract_ros.reporting.metrics.team_account import account_metrics
from noninteract_ros.reporting.metrics.zero_order_hold import recorded_hold_force
from noninteract_ros.reporting.recording.recorded import Recorded
from noninteract_ros.reporting.rehearsed.comparison import Comparer

FORMAT = 2
LEVELS = ("OK", "WARN", "ERROR", "STALE")


@dataclass(frozen=True)
class Findings:
    """Metrics and checks of a run.

    Attributes:
        metrics: Sections of `metrics.json`; units are in the keys.
        checks: Checks of the run.
    """

    metrics: dict[str, Any]
    checks: list[Check]


def measure(recorded: Recorded, other_laws: bool = True) -> Findings:
    """Compute all metrics and checks of a run.

    Args:
        recorded: The run.
        other_laws: True to rehearse the scenario under other laws as well, for comparison.

    Raises:
        RecordingError: The recording is malformed.
    """
    external = influences(recorded)
    completeness, checks = completeness_metrics(recorded)
    metrics: dict[str, Any] = {
        "format": FORMAT,
        "run": _run_metrics(recorded, external),
        "completeness": completeness,
        "tracking": _by_subtask(recorded, tracking_metrics),
    }
    closed, closed_checks = closed_form_metrics(recorded, external)
    comparison = Comparer(recorded, external, other_laws).compare()
    hold = recorded_hold_force(recorded) if recorded.lockstep else None
    energies: dict[str, Any] = {}
    energy_checks: list[Check] = []
    for name in recorded.stack.names:
        try:
            energies[name], found = energy_metrics(recorded, name, hold)
        except RecordingError as error:
            energies[name] = {"reason": str(error)}
            found = [not_applicable(f"storage_positive.{name}", 0.0, "J", str(error))]
        energy_checks += found
    metrics |= {"closed_form": closed, **comparison.metrics, "energy": energies}
    metrics["account"], account_checks = account_metrics(recorded)
    metrics["passivity"], passivity_checks = passivity_metrics(recorded)
    metrics["diagnostics"], diagnostic_checks = diagnostics_metrics(recorded)
    link, link_checks = link_metrics(recorded)
    metrics |= link
    checks += [*closed_checks, *comparison.checks, *energy_checks, *account_checks]
    checks += [*passivity_checks, *diagnostic_checks, *link_checks]
    return Findings(metrics, checks)


def _run_metrics(recorded: Recorded, external: list[Influence]) -> dict[str, Any]:
    general = recorded.scenario.general
    return {
        "law": general.law,
        "lockstep": general.lockstep,
        "rate_Hz": general.rate,
        "duration_s": float(recorded.t[-1] - recorded.t[0]),
        "robots": list(recorded.team.names),
        "subtasks": list(recorded.stack.names),
        "external_influences": [item.text for item in external],
    }


def _by_subtask(
    recorded: Recorded, measure_one: Callable[[Recorded, str], dict[str, Any]]
) -> dict[str, Any]:
    found = {}
    for name in recorded.stack.names:
        try:
            found[name] = measure_one(recorded, name)
        except RecordingError as error:
            found[name] = {"reason": str(error)}
    return found


def completeness_metrics(recorded: Recorded) -> tuple[dict[str, Any], list[Check]]:
    """Return counts of missing ticks, missing commands and invalid states."""
    ticks = recorded.ticks
    first = 0 if recorded.lockstep else int(ticks[0])
    expected = int(ticks[-1]) - first + 1
    log_times = recorded.run.log_times("joint_states")
    wall = float(log_times[-1] - log_times[0]) * 1e-9
    commands: Array = np.zeros(0)
    if recorded.has("joint_commands"):
        commands = recorded.run.joints("joint_commands").stamps
    commanded, published = (
        set(np.round(stamps * 1e9).astype(np.int64).tolist())
        for stamps in (commands, recorded.states.stamps)
    )
    # The last state of a run needs no command.
    last = max(published)
    unanswered = len(published - commanded - {last})
    without_state = len(commanded - published)
    counts = {
        "ticks_missing": expected - len(np.unique(ticks)),
        "states_out_of_order": int((np.diff(ticks) <= 0).sum()),
        "states_unanswered": unanswered,
        "commands_without_state": without_state,
        "numbers_not_finite": int((~np.isfinite(np.hstack((recorded.q, recorded.v)))).sum()),
    }
    metrics = {
        "ticks": len(ticks),
        **counts,
        "wall_time_s": wall,
        "ticks_per_second": len(ticks) / wall if wall > 0.0 else None,
    }
    if not recorded.lockstep:
        reason = "wall time: ticks may be late and commands may answer several states"
        return metrics, [not_applicable(f"complete.{key}", 0.0, "", reason) for key in counts]
    return metrics, [at_most(f"complete.{key}", found, 0.0, "") for key, found in counts.items()]


def tracking_metrics(recorded: Recorded, subtask: str) -> dict[str, Any]:
    """Return errors from the first reference on: distances of elements, angles of rotations.

    A subtask without references is to hold its value from the first state on.

    Raises:
        RecordingError: A topic is missing or of another type.
    """
    tracking = recorded.tracking(subtask)
    start = recorded.start(subtask)
    rows = tracking.t >= (tracking.t[:1].min(initial=0.0) if start is None else start) - 1e-9
    if not rows.any():
        return {"reason": "no values while the subtask was led"}
    task = recorded.task(subtask)
    e = task.difference(tracking.actual.position[rows], tracking.desired.position[rows])
    metrics: dict[str, Any] = {"led_from_s": start}
    for unit, sizes in task.magnitudes(e).items():
        metrics |= _extremes(sizes, unit)
    return metrics


def _extremes(sizes: Array, unit: str) -> dict[str, float]:
    """Return initial, largest, RMS and final error of errors, shape (n, elements)."""
    return {
        f"initial_error_{unit}": float(sizes[0].max()),
        f"max_error_{unit}": float(sizes.max()),
        f"rms_error_{unit}": float(np.sqrt((sizes**2).mean())),
        f"final_error_{unit}": float(sizes[-1].max()),
    }


def closed_form_metrics(
    recorded: Recorded, external: list[Influence]
) -> tuple[dict[str, Any], list[Check]]:
    """Return the deviation of each subtask from its closed-form dynamics (29)."""
    metrics: dict[str, Any] = {}
    checks = []
    for name in recorded.stack.names:
        try:
            found = closed_form(recorded, name, external)
        except (NotApplicableError, RecordingError) as error:
            metrics[name] = {"reason": str(error)}
            checks.append(closed_form_check(recorded, name, str(error)))
            continue
        metrics[name] = {
            "from_s": found.start,
            "states": len(found.t),
            "inertia_diagonal": np.diag(found.inertia).tolist(),
        }
        units = np.array(recorded.task(name).units)
        for unit in dict.fromkeys(units.tolist()):
            off = found.deviation[:, units == unit]
            metrics[name] |= {
                f"max_deviation_{unit}": float(np.abs(off).max()),
                f"rms_deviation_{unit}": float(np.sqrt((off**2).mean())),
            }
        checks.append(closed_form_check(recorded, name, found))
    return metrics, checks


def diagnostics_metrics(recorded: Recorded) -> tuple[dict[str, Any], list[Check]]:
    """Return worst and last level and rejected inputs of each node, and the recorder's losses."""
    nodes: dict[str, Any] = {}
    statuses = recorded.run.diagnostics() if recorded.has("diagnostics") else []
    lost = None
    for status in statuses:
        level = min(int(status["level"]), len(LEVELS) - 1)
        node = nodes.setdefault(
            status["name"], {"worst_level": "OK", "last_level": "OK", "refused_inputs": 0}
        )
        node["worst_level"] = LEVELS[max(level, LEVELS.index(node["worst_level"]))]
        node["last_level"], node["last_message"] = LEVELS[level], status["message"]
        values = status["values"]
        node["refused_inputs"] = int(values.get("rejected inputs", node["refused_inputs"]))
        if "last rejection" in values:
            node["last_refusal"] = values["last rejection"]
        lost = int(values["lost"]) if "lost" in values else lost
    reason = "the recorder published no status"
    check = (
        not_applicable("recorder_lost", 0.0, "", reason)
        if lost is None
        else at_most("recorder_lost", lost, 0.0, "")
    )
    return nodes, [check]
