# SPDX-License-Identifier: Apache-2.0
"""What an operator's loop over a link does, without ROS: the runs behind `check delay`."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import find_scenario, read_parameters
from noninteract_ros.scenario.rehearsal import Rehearsal
from noninteract_ros.sources.link.settings import LinkSettings

BASE = "delayed_wall"
DURATION = 4.0  # [s] until the operator of the base begins to come back
LATE = 1.0  # [s] at the end in which the hand has to be at rest
BOX = {"kind": "rigid_object", "mass": 2.0, "stiffness": 3000.0, "damping": 40.0}
PLACES: dict[str, dict[str, Any]] = {"free": {}, "wall": {}, "carrying": {"box": BOX}}


@dataclass(frozen=True)
class LinkRun:
    """What happened over a link, a row per tick.

    Attributes:
        t: Time, shape (ticks,) [s].
        hand: Velocity of the device, shape (ticks, p) [m/s].
        net: Energy that the operator has put in less what came out, shape (ticks,) [J].
        budget: What the device's end may still give, shape (ticks,) [J].
        feedback: Force that the team reflects, shape (ticks, p) [N].
        behind: Distance between device and team, shape (ticks,) [m].
        reserve: What the team's end could spend beforehand [J].
        surprise: What single ticks can have overdrawn before they were observed [J].
    """

    t: Array
    hand: Array
    net: Array
    budget: Array
    feedback: Array
    behind: Array
    reserve: float
    surprise: float

    @property
    def restlessness(self) -> float:
        """Root mean square of the hand's speed at the end [m/s]."""
        late = self.hand[self.t >= self.t[-1] - LATE]
        return float(np.sqrt((late * late).sum(axis=1).mean()))

    @property
    def drawn(self) -> float:
        """Most energy that the operator has got out beyond what was put in [J]."""
        return max(0.0, -float(self.net.min()))

    @property
    def beyond(self) -> float:
        """By how much the account exceeds what is proven of it [J]; not positive if it holds."""
        balance = self.drawn - self.reserve - self.surprise
        return max(balance, -float(self.budget.min()) - self.surprise)


def scenario(place: str, delay: float, passivity: str, **link: Any) -> Scenario:
    """The base scenario with something of its link and its surroundings changed."""
    values = read_parameters(find_scenario(BASE))
    values["link"] |= {"delay": delay, "passivity": passivity, **link}
    if place != "wall":
        del values["wall"]
        values |= PLACES[place] | {"surroundings": [*PLACES[place]]}
    return Scenario.from_dict(values)


def link_of(found: Scenario) -> LinkSettings:
    """The link of a scenario that has one."""
    assert found.link is not None
    return found.link


def run(found: Scenario, duration: float = DURATION) -> LinkRun:
    """Runs a scenario with a link, without ROS, for a time [s]."""
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
        behind = np.linalg.norm(layout.difference(motion.position, tick.task.x[values]))
        force = tick.feedback[part]
        energies = account.operator_net, account.device_budget
        rows.append((now, motion.velocity, *energies, force, behind))
        surprise = account.surprise
    t, hand, net, budget, feedback, gap = (np.array(part) for part in zip(*rows, strict=True))
    reserve = link_of(found).reserve
    return LinkRun(t, hand, net, budget, feedback, gap, reserve, surprise)
