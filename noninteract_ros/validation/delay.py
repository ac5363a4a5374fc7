# SPDX-License-Identifier: Apache-2.0
"""`noninteract check delay`: teleoperation over a delayed link, with and without passivity.

Each cell of the table is a rehearsal of the scenario `delayed_wall` with another delay, passivity
layer, network or environment. The operator moves 5 cm beyond the wall and rests there. A loop is
settled if the hand then rests except for its tremor. Varying networks are run with several seeds;
a cell contains the worst result.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.reporting.checks.check_report import CheckReport, Section
from noninteract_ros.reporting.checks.checks import Check, at_least, at_most
from noninteract_ros.reporting.metrics.link_metrics import ROUNDING
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import find_scenario, read_parameters
from noninteract_ros.scenario.rehearsal import Rehearsal
from noninteract_ros.sources.link.settings import LinkSettings

BASE = "delayed_wall"
DURATION = 4.0  # [s] until the operator of the base scenario returns
LATE = 1.0  # [s] final interval in which the hand must be at rest
BOX = {"kind": "rigid_object", "mass": 2.0, "stiffness": 3000.0, "damping": 40.0}
PLACES: dict[str, dict[str, Any]] = {"free": {}, "wall": {}, "carrying": {"box": BOX}}
DELAYS = (0.0, 0.01, 0.05, 0.1, 0.2)  # [s] one way
STEADY: dict[str, Any] = {"jitter": 0.0, "loss": 0.0}
VARYING: dict[str, Any] = {"jitter": 0.3, "loss": 0.05, "reordering": True}
NETWORKS = {"constant": STEADY, "varying": VARYING}
SEEDS = 3  # default number of seeds of a varying network
MAX_RMS_SPEED = 0.05  # [m/s] largest RMS speed of a hand at rest
MAX_OFFSET = {"free": 0.005, "wall": 0.05, "carrying": 0.005}  # [m] between hand and team at rest
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


@dataclass(frozen=True)
class LinkRun:
    """Signals of a link, one row per tick.

    Attributes:
        t: Time, shape (ticks,) [s].
        hand: Velocity of the device, shape (ticks, p) [m/s].
        net: Net energy that the operator put in, shape (ticks,) [J].
        budget: Energy budget of the device's end, shape (ticks,) [J].
        feedback: Force reflected by the team, shape (ticks, p) [N].
        offset: Distance between device and team, shape (ticks,) [m].
        reserve: Initial budget of the team's end [J].
        surprise: Largest overdraft of single ticks before they are observed [J].
    """

    t: Array
    hand: Array
    net: Array
    budget: Array
    feedback: Array
    offset: Array
    reserve: float
    surprise: float

    @property
    def rms_speed(self) -> float:
        """RMS speed of the hand in the final interval [m/s]."""
        late = self.hand[self.t >= self.t[-1] - LATE]
        return float(np.sqrt((late * late).sum(axis=1).mean()))

    @property
    def drawn(self) -> float:
        """Largest net energy drawn by the operator [J]."""
        return max(0.0, -float(self.net.min()))

    @property
    def excess(self) -> float:
        """Energy drawn beyond the proven bound [J]; not positive if the bound holds."""
        balance = self.drawn - self.reserve - self.surprise
        return max(balance, -float(self.budget.min()) - self.surprise)


def scenario(place: str, delay: float, passivity: str, **link: Any) -> Scenario:
    """Return the base scenario with another link and environment."""
    values = read_parameters(find_scenario(BASE))
    values["link"] |= {"delay": delay, "passivity": passivity, **link}
    if place != "wall":
        del values["wall"]
        values |= PLACES[place] | {"surroundings": [*PLACES[place]]}
    return Scenario.from_dict(values)


def link_of(found: Scenario) -> LinkSettings:
    """Return the link of a scenario with a link."""
    assert found.link is not None
    return found.link


def run(found: Scenario, duration: float = DURATION) -> LinkRun:
    """Rehearse a scenario with a link for a duration [s]."""
    rehearsal = Rehearsal(found)
    link = rehearsal.link
    assert link is not None
    assert found.haptic is not None
    place = rehearsal.stack.names.index(found.haptic.subtask)
    part, layout = rehearsal.stack.slices[place], rehearsal.stack.subtasks[place].layout
    values = rehearsal.stack.value_slices[place]
    rows = []
    surprise = 0.0
    for _ in range(round(duration * found.general.rate)):
        now, tick = rehearsal.simulation.now, rehearsal.step()
        account = link.account
        if account is None:
            continue
        motion = link.device_motion
        offset = np.linalg.norm(layout.difference(motion.position, tick.task.x[values]))
        force = tick.feedback[part]
        energies = account.operator_net, account.device_budget
        rows.append((now, motion.velocity, *energies, force, offset))
        surprise = account.surprise
    t, hand, net, budget, feedback, gap = (np.array(part) for part in zip(*rows, strict=True))
    reserve = link_of(found).reserve
    return LinkRun(
        t=t,
        hand=hand,
        net=net,
        budget=budget,
        feedback=feedback,
        offset=gap,
        reserve=reserve,
        surprise=surprise,
    )


def check_delay(samples: int | None, seed: int) -> CheckReport:
    """Tabulate delays with and without passivity: free, at a wall and carrying an object.

    Args:
        samples: Number of seeds of a varying network; None for the default.
        seed: First seed.
    """
    rows: list[tuple[Any, ...]] = []
    checks: list[Check] = []
    count = samples or SEEDS
    seeds = range(seed, seed + count)
    for place in PLACES:
        unstable = 0
        for delay in DELAYS:
            for network in NETWORKS:
                bare, kept = (
                    _runs(place, delay, network, passivity, seeds)
                    for passivity in ("none", "tdpa")
                )
                rows.append((place, 1e3 * delay, network, *_cells(bare), *_cells(kept)))
                checks += _checks(
                    f"{place}, {1e3 * delay:g} ms, {network}", kept, MAX_OFFSET[place]
                )
                unstable += _rms_speed(bare) > MAX_RMS_SPEED
        name = f"unstable networks without passivity, {place}"
        checks.append(at_least(name, unstable, 1.0, ""))
    jitter, loss = 100 * VARYING["jitter"], 100 * VARYING["loss"]
    return CheckReport(
        f"{BASE} without ROS; varying: +-{jitter:g} % delay, {loss:g} % loss, "
        f"reordering, worst of {count} seeds",
        (Section("delay", COLUMNS, tuple(rows)),),
        tuple(checks),
        (),
        brief=True,
    )


def _runs(
    place: str, delay: float, network: str, passivity: str, seeds: Sequence[int]
) -> list[LinkRun]:
    """Return the runs of a cell; a single one for constant networks."""
    chosen = seeds if NETWORKS[network] is VARYING else seeds[:1]
    changes = NETWORKS[network]
    return [run(scenario(place, delay, passivity, seed=seed, **changes)) for seed in chosen]


def _rms_speed(runs: list[LinkRun]) -> float:
    return max(run.rms_speed for run in runs)


def _cells(runs: list[LinkRun]) -> tuple[float, float, str]:
    rms_speed = _rms_speed(runs)
    state = "settled" if rms_speed <= MAX_RMS_SPEED else "UNSTABLE"
    return rms_speed, max(run.drawn for run in runs), state


def _checks(name: str, runs: list[LinkRun], max_offset: float) -> list[Check]:
    """Check the worst results of a cell with passivity."""
    excess = max(run.excess for run in runs)
    offset = max(float(run.offset[-1]) for run in runs)
    return [
        at_most(f"RMS hand speed, {name}", _rms_speed(runs), MAX_RMS_SPEED, "m/s"),
        at_most(f"energy drawn beyond the bound, {name}", excess, ROUNDING, "J"),
        at_most(f"offset of hand and team, {name}", offset, max_offset, "m"),
    ]
