# SPDX-License-Identifier: Apache-2.0
"""`noninteract check delay`: an operator's loop over a delayed link, with passivity and without.

Each cell of the table is the scenario `delayed_wall` without ROS, with its delay, its passivity,
its network and its surroundings changed. The operator goes 5 cm beyond the place of the wall and
means to rest there. A loop is settled where the hand then rests but for its tremor. A network that
varies is tried with several seeds; a cell has the worst of them.
"""

from collections.abc import Sequence
from typing import Any

from noninteract_ros.reporting.checks.check_report import CheckReport, Section
from noninteract_ros.reporting.checks.checks import Check, at_least, at_most
from noninteract_ros.reporting.metrics.link_metrics import ROUNDING
from noninteract_ros.validation.delay import link_runs
from noninteract_ros.validation.delay.link_runs import LinkRun, scenario

DELAYS = (0.0, 0.01, 0.05, 0.1, 0.2)  # [s] one way
STEADY: dict[str, Any] = {"jitter": 0.0, "loss": 0.0}
VARYING: dict[str, Any] = {"jitter": 0.3, "loss": 0.05, "reordering": True}
NETWORKS = {"constant": STEADY, "varying": VARYING}
SEEDS = 3  # of a network that varies, unless another number is asked for
RESTLESS = 0.05  # [m/s] root mean square of the hand's velocity beyond which it is not at rest
FAR = {"free": 0.005, "wall": 0.05, "carrying": 0.005}  # [m] from hand to team, at rest
COLUMNS = (
    "",
    "delay [ms]",
    "network",
    *(
        f"{value} {name}"
        for name in ("without", "with")
        for value in ("hand [m/s]", "drawn [J]", "loop")
    ),
)


def check_delay(samples: int | None, seed: int) -> CheckReport:
    """Tabulate delays with and without passivity: free, at a wall and carrying an object.

    Args:
        samples: Number of seeds of a network that varies; None for the default.
        seed: The first of them.
    """
    rows: list[tuple[Any, ...]] = []
    checks: list[Check] = []
    count = samples or SEEDS
    seeds = range(seed, seed + count)
    for place in link_runs.PLACES:
        unstable = 0
        for delay in DELAYS:
            for network in NETWORKS:
                bare, kept = (
                    _runs(place, delay, network, passivity, seeds)
                    for passivity in ("none", "tdpa")
                )
                rows.append((place, 1e3 * delay, network, *_cells(bare), *_cells(kept)))
                checks += _claims(f"{place}, {1e3 * delay:g} ms, {network}", kept, FAR[place])
                unstable += _restlessness(bare) > RESTLESS
        name = f"networks in which the loop is unstable without passivity, {place}"
        checks.append(at_least(name, unstable, 1.0, ""))
    jitter, loss = 100 * VARYING["jitter"], 100 * VARYING["loss"]
    return CheckReport(
        f"{link_runs.BASE} without ROS; varying: +-{jitter:g} % delay, {loss:g} % lost, "
        f"overtaking, worst of {count} seeds",
        (Section("delay", COLUMNS, tuple(rows)),),
        tuple(checks),
        (),
        brief=True,
    )


def _runs(
    place: str, delay: float, network: str, passivity: str, seeds: Sequence[int]
) -> list[LinkRun]:
    """The runs of a cell; one where no chance is involved."""
    chosen = seeds if NETWORKS[network] is VARYING else seeds[:1]
    changes = NETWORKS[network]
    return [
        link_runs.run(scenario(place, delay, passivity, seed=seed, **changes)) for seed in chosen
    ]


def _restlessness(runs: list[LinkRun]) -> float:
    return max(run.restlessness for run in runs)


def _cells(runs: list[LinkRun]) -> tuple[float, float, str]:
    restlessness = _restlessness(runs)
    verdict = "settled" if restlessness <= RESTLESS else "UNSTABLE"
    return restlessness, max(run.drawn for run in runs), verdict


def _claims(name: str, runs: list[LinkRun], far: float) -> list[Check]:
    """Of each run of a cell with passivity, by its worst."""
    beyond = max(run.beyond for run in runs)
    behind = max(float(run.behind[-1]) for run in runs)
    return [
        at_most(f"hand at rest, {name}", _restlessness(runs), RESTLESS, "m/s"),
        at_most(f"drawn beyond the bound, {name}", beyond, ROUNDING, "J"),
        at_most(f"from hand to team, {name}", behind, far, "m"),
    ]
