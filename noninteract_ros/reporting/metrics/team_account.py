# SPDX-License-Identifier: Apache-2.0
"""Energy account of the team in a recording: series over time, metrics and checks."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.control.energy.account import QUANTITIES
from noninteract_ros.control.energy.gate import GATED
from noninteract_ros.errors import RecordingError
from noninteract_ros.reporting.checks.checks import Check, at_least, at_most, not_applicable
from noninteract_ros.reporting.metrics.intervals import laws
from noninteract_ros.reporting.recording.recorded import INTERVENTIONS, Recorded, common_times

TOPIC = "energy"
# Words in the diagnostic message of the controller while limits change the torque.
LIMITS = ("limit", "too fast", "singularity", "no finite torque")
# Rounding error of the residual per tick, relative to the largest sum.
ROUNDING = 64.0 * float(np.finfo(float).eps)


@dataclass(frozen=True)
class TeamAccount:
    """Published energy account over time, shape (m,) each.

    Attributes:
        t: Time of the run [s].
        gated: True where the law in force has gates.
        storage: T + nu U of the errors [J].
        supplied: Power at the physical port [W].
        dissipated: Power dissipated by the impedance [W].
        demand: Power that complete decoupling would inject [W].
        tank: Energy in the tank [J].
        owed: Energy that must be received before sigma may rise [J].
        reserve: Energy in the reserve [J].
        sigma: Decoupling gate.
        nu: Gate of the springs.
        residual: Growth of all storage beyond all received energy [J].
        received: Work of the environment since the start of the account [J].
        measured: Integral of `supplied` since then [J].
        brought: Energy injected by moving references and force inputs since then [J].
        credit: Tank energy granted for that since then [J].
        refilled: Energy granted by an operator to tank and reserve since then [J].
        lost: Energy withheld or discarded since then [J].
        account: Number of the account; all sums restart with it.
    """

    t: Array
    gated: NDArray[np.bool_]
    storage: Array
    supplied: Array
    dissipated: Array
    demand: Array
    tank: Array
    owed: Array
    reserve: Array
    sigma: Array
    nu: Array
    residual: Array
    received: Array
    measured: Array
    brought: Array
    credit: Array
    refilled: Array
    lost: Array
    account: Array


def team_account(recorded: Recorded) -> TeamAccount:
    """Return the published account.

    Raises:
        RecordingError: The topic is missing, of another type, empty or without one of its labels.
    """
    series = recorded.run.labelled(recorded.team_topic(TOPIC))
    missing = [label for label in QUANTITIES if label not in series.labels]
    if missing or not len(series.stamps):
        raise RecordingError(f"{recorded.run.path}: {TOPIC} lacks {', '.join(missing) or 'data'}")
    columns = {label: series[label] for label in QUANTITIES}
    t = recorded.since_start(series.stamps)
    return TeamAccount(t, laws(recorded, t) == GATED, **columns)


def account_metrics(recorded: Recorded) -> tuple[dict[str, Any], list[Check]]:
    """Return metrics and checks of gates, levels and residual of the account."""
    names = ("account.residual", "account.sigma", "account.nu")
    try:
        found = team_account(recorded)
    except RecordingError as error:
        reason = str(error)
        return {"reason": reason}, [not_applicable(name, 0.0, "", reason) for name in names]
    steps, gated = np.diff(found.t, append=found.t[-1]), found.gated
    metrics: dict[str, Any] = {
        "gated_s": float(steps[gated].sum()),
        "sigma_min": float(found.sigma[gated].min()) if gated.any() else None,
        "sigma_below_1_s": float(steps[gated & (found.sigma < 1.0)].sum()),
        "nu_min": float(found.nu[gated].min()) if gated.any() else None,
        "nu_below_1_s": float(steps[gated & (found.nu < 1.0)].sum()),
        "residual_max_J": float(found.residual.max()),
        "tank_min_J": float(found.tank.min()),
        "tank_max_J": float(found.tank.max()),
        "reserve_min_J": float(found.reserve.min()),
        "storage_max_J": float(found.storage.max()),
        "received_J": float(found.received[-1]),
        "lost_J": float(found.lost[-1]),
        "credit_J": float(found.credit[-1]),
        "refilled_J": float(found.refilled[-1]),
        "accounts": len(np.unique(found.account)),
    }
    checks = [at_most(names[0], metrics["residual_max_J"], _rounding(recorded, found), "J")]
    reason = _may_close(recorded, found)
    for name, lowest in zip(names[1:], ("sigma_min", "nu_min"), strict=True):
        checks.append(
            not_applicable(name, 1.0, "", reason)
            if reason
            else at_least(name, metrics[lowest], 1.0, "")
        )
    return metrics, checks


def _rounding(recorded: Recorded, found: TeamAccount) -> float:
    """Return the largest residual due to rounding of all sums [J]."""
    sums = (found.storage, found.tank, found.reserve, found.received, found.brought, found.lost)
    scale = sum(float(np.abs(item).max()) for item in sums)
    return ROUNDING * len(recorded.t) * scale


def _may_close(recorded: Recorded, found: TeamAccount) -> str:
    """Return the reason why a gate may close in this run, or an empty text."""
    scenario = recorded.scenario
    if not found.gated.any():
        return f"law {scenario.general.law} has no gates"
    if not recorded.lockstep:
        return "wall time: torques act late, which costs energy"
    if contacts := [*scenario.surroundings, *scenario.pushes]:
        return f"contact may close a gate: {', '.join(contacts)}"
    if any(recorded.has(f"{robot}/push") for robot in scenario.robots):
        return "external pushes may close a gate"
    if limits_acted(recorded, found):
        return "joint limits or singularities may close a gate"
    return ""


def limits_acted(recorded: Recorded, found: TeamAccount) -> bool:
    """Return True if joint limits or singularities changed the torque of the law.

    Detected from the controller diagnostics, and from interventions: of a team with effort limits
    at any time, since these close gates themselves, else while both gates are open.
    """
    statuses = recorded.run.diagnostics() if recorded.has("diagnostics") else []
    for status in statuses:
        message = status["name"].endswith("controller") and status["message"]
        if message and any(word in message for word in LIMITS):
            return True
    series = recorded.run.labelled(f"{recorded.stack.names[0]}/energy")
    if INTERVENTIONS not in series.labels:
        return False
    rows, others = common_times(recorded.since_start(series.stamps), found.t)
    both_open = (found.sigma[others] == 1.0) & (found.nu[others] == 1.0)
    more = np.diff(series[INTERVENTIONS][rows]) > 0.0
    if np.isfinite(recorded.team.effort_limits).any():
        return bool(more.any())
    return bool((more & both_open[1:] & both_open[:-1]).any())
