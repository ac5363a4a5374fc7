# SPDX-License-Identifier: Apache-2.0
"""`noninteract check delay`: an operator's loop over a delayed link, with passivity and without.

Each cell of the table is the scenario `delayed_wall` without ROS, with its delay, passivity and
surroundings changed. The operator goes 5 cm beyond the place of the wall and means to rest there.
A loop is settled where the hand then rests but for its tremor.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from noninteract_ros.analysis.check_report import CheckReport, CheckSettings, Section
from noninteract_ros.analysis.checks import Check, at_least, at_most
from noninteract_ros.analysis.link_metrics import SLACK
from noninteract_ros.arrays import Array
from noninteract_ros.operator.link_settings import LinkSettings
from noninteract_ros.rehearsal import Rehearsal
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario_file import find_scenario, read_parameters

BASE = "delayed_wall"
DELAYS = (0.0, 0.01, 0.05, 0.1, 0.2)  # [s] one way
DURATION = 4.0  # [s] until the operator of the base begins to come back
LATE = 1.0  # [s] at the end in which the hand has to be at rest
RESTLESS = 0.05  # [m/s] root mean square of the hand's velocity beyond which it is not
BOX = {"kind": "rigid_object", "mass": 2.0, "stiffness": 3000.0, "damping": 40.0}
PLACES: dict[str, dict[str, Any]] = {"free": {}, "wall": {}, "carrying": {"box": BOX}}


@dataclass(frozen=True)
class LinkRun:
    """What happened over a link, a row per tick.

    Attributes:
        t: Time, shape (ticks,) [s].
        hand: Velocity of the device, shape (ticks, p) [m/s].
        net: Energy that the operator has put in less what came out, shape (ticks,) [J].
        feedback: Force that the team reflects, shape (ticks, p) [N].
        behind: Distance between device and team, shape (ticks,) [m].
    """

    t: Array
    hand: Array
    net: Array
    feedback: Array
    behind: Array

    @property
    def restlessness(self) -> float:
        """Root mean square of the hand's speed at the end [m/s]."""
        late = self.hand[self.t >= self.t[-1] - LATE]
        return float(np.sqrt((late * late).sum(axis=1).mean()))

    @property
    def drawn(self) -> float:
        """Most energy that the operator has got out beyond what was put in [J]."""
        return max(0.0, -float(self.net.min()))


def scenario(place: str, delay: float, passivity: str, **link: float) -> Scenario:
    """The base scenario with something of its link and its surroundings changed."""
    values = read_parameters(find_scenario(BASE))
    values["link"] |= {"delay": delay, "passivity": passivity, **link}
    if place != "wall":
        del values["wall"]
        values |= PLACES[place] | {"surroundings": [*PLACES[place]]}
    return Scenario.from_dict(values)


def run(found: Scenario, duration: float = DURATION) -> LinkRun:
    """Runs a scenario with a link, without ROS, for a time [s]."""
    rehearsal = Rehearsal(found)
    link = rehearsal.link
    assert link is not None
    assert found.haptic is not None
    part = rehearsal.stack.slices[rehearsal.stack.names.index(found.haptic.subtask)]
    rows = []
    for _ in range(round(duration * found.general.rate)):
        now, tick = rehearsal.simulation.now, rehearsal.step()
        if link.account is None:
            continue
        motion = link.device_motion
        behind = np.linalg.norm(motion.position - tick.task.x[part])
        rows.append((now, motion.velocity, link.account.operator_net, tick.feedback[part], behind))
    return LinkRun(*(np.array(column) for column in zip(*rows, strict=True)))


def delay_check(settings: CheckSettings) -> CheckReport:
    """The table: delay, with and without passivity, free, at a wall and carrying an object."""
    rows, checks, unstable = [], [], 0
    reserve = link_of(scenario("wall", 0.0, "tdpa")).reserve
    for place in PLACES:
        for delay in DELAYS:
            bare, kept = (
                run(_seeded(scenario(place, delay, passivity), settings.seed))
                for passivity in ("none", "tdpa")
            )
            rows.append((place, 1e3 * delay, *_cells(bare), *_cells(kept)))
            checks += _claims(f"{place}, {1e3 * delay:g} ms", kept, reserve)
            unstable += bare.restlessness > RESTLESS
    checks.append(at_least("loops that are unstable without passivity", unstable, 1.0, ""))
    columns = ["", "delay [ms]"]
    for name in ("without", "with"):
        columns += [f"hand {name} [m/s]", f"drawn {name} [J]", name]
    return CheckReport(
        f"a link that jitters and loses packets, {BASE} without ROS",
        (Section("delay", tuple(columns), tuple(rows)),),
        tuple(checks),
        (),
    )


def link_of(found: Scenario) -> LinkSettings:
    """The link of a scenario that has one."""
    assert found.link is not None
    return found.link


def _seeded(found: Scenario, seed: int) -> Scenario:
    return replace(found, link=replace(link_of(found), seed=seed))


def _cells(found: LinkRun) -> tuple[float, float, str]:
    verdict = "settled" if found.restlessness <= RESTLESS else "UNSTABLE"
    return found.restlessness, found.drawn, verdict


def _claims(name: str, found: LinkRun, reserve: float) -> list[Check]:
    return [
        at_most(f"hand at rest, {name}", found.restlessness, RESTLESS, "m/s"),
        at_most(f"energy drawn, {name}", found.drawn, reserve + SLACK, "J"),
    ]
