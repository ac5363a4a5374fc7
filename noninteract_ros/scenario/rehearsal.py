# SPDX-License-Identifier: Apache-2.0
"""A scenario without ROS: the same ticks as the programs take in lockstep, to the last bit."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.energy.storage import Energy
from noninteract_ros.control.tick import Tick
from noninteract_ros.scenario.scenario import Scenario
from noninteract_ros.sources.announcements import Announcer
from noninteract_ros.sources.link.bilateral import BilateralLink


@dataclass(frozen=True)
class History:
    """What happened, a row per tick.

    Attributes:
        t: Time, shape (ticks,) [s].
        q: Configuration, shape (ticks, nq).
        v: Velocity, shape (ticks, n).
        torque: Control torque, shape (ticks, n) [N or N m].
        x: Subtask values, shape (ticks, size).
        x_rate: Subtask velocities, shape (ticks, n).
        desired: Desired subtask values, shape (ticks, size).
        storage: Storage functions, shape (ticks, subtasks) [J].
        storage_rate: Their rates, shape (ticks, subtasks) [W].
    """

    t: Array
    q: Array
    v: Array
    torque: Array
    x: Array
    x_rate: Array
    desired: Array
    storage: Array
    storage_rate: Array


class Rehearsal:
    """All programs of a scenario in one object, stepped by hand.

    Args:
        scenario: What to run.
        human: Whether the haptic device speaks, if the scenario has one.
        autonomy: Whether the planner speaks, if the scenario has one.

    Attributes:
        link: The link between the operator's device and the team, if the scenario has one.
    """

    def __init__(self, scenario: Scenario, human: bool = True, autonomy: bool = True) -> None:
        self.team = scenario.build_team()
        self.stack = scenario.build_stack(self.team)
        self.controller = scenario.build_controller(self.team, self.stack)
        self.simulation = scenario.build_simulation(self.team, self.stack)
        self._felt: str | None = None
        self.link: BilateralLink | None = None
        self._sources: list[tuple[str, str, Announcer]] = []
        rate = scenario.general.rate
        if human and scenario.haptic:
            device = scenario.build_haptic(self.stack)
            self.link = device if isinstance(device, BilateralLink) else None
            self._sources.append((scenario.haptic.subtask, "human", Announcer(device, rate)))
            self._felt = scenario.haptic.subtask if scenario.haptic.hand_mass > 0.0 else None
        if autonomy and scenario.planner:
            planner = scenario.build_planner(self.stack)
            self._sources.append((scenario.planner.subtask, "autonomy", Announcer(planner, rate)))
        for _, _, announcer in self._sources:
            announcer.reset(0.0)
        self._feedback: Array | None = None
        general = scenario.general
        self._telling = max(1, round(rate / general.telemetry_rate))
        self._sensed = np.array([name in general.force_sensors for name in self.team.names])
        self._wrenches = np.zeros((len(self.team.names), 6))

    @property
    def q(self) -> Array:
        """Configuration, shape (nq,), as joint states carry it: continuous joints by angles."""
        positions = self.team.joints_from_configuration(self.simulation.q)
        return self.team.configuration_from_joints(positions)

    def step(self) -> Tick:
        """One tick: sources, controller, team."""
        now = self.simulation.now
        for subtask, source, announcer in self._sources:
            heard = self.controller.inputs[subtask].sources[source]
            feedback = self._feedback if source == "human" else None
            for stamp, reference in announcer.announce(now, feedback):
                if reference is not None:
                    heard.receive(stamp / 1e9, reference, now)
        if self.controller.feels and self.simulation.tick % self._telling == 0:
            self._wrenches = self.simulation.external_wrenches() * self._sensed[:, None]
        wrenches = self._wrenches
        tick = self.controller.step(now, self.q, self.simulation.v, wrenches=wrenches)
        if self._felt:
            part = self.stack.slices[self.stack.names.index(self._felt)]
            self._feedback = tick.feedback[part]
        self.simulation.step(self.command(tick))
        return tick

    def command(self, tick: Tick) -> Array:
        """Torque that the team gets, shape (n,); another one than the law's in a comparison."""
        return tick.torque

    def energy(self, tick: Tick, wrenches: Array) -> Energy:
        """Storage functions and rates of a tick, with wrenches on the tools, shape (N, 6)."""
        return self.controller.energy(tick, self.team.external_torque(tick.state, wrenches))

    def run(self, duration: float) -> History:
        """Runs for a time [s] and keeps everything."""
        ticks = round(duration * self.simulation.rate)
        rows = list(self._rows(ticks))
        return History(*(np.array(column) for column in zip(*rows, strict=True)))

    def _rows(self, ticks: int) -> Iterator[tuple[object, ...]]:
        for _ in range(ticks):
            now = self.simulation.now
            wrenches = self.simulation.external_wrenches()
            tick = self.step()
            energy = self.energy(tick, wrenches)
            desired = np.concatenate([led.reference.position for led in tick.led])
            yield (
                now,
                tick.state.q,
                tick.state.v,
                tick.torque,
                tick.task.x,
                tick.x_rate,
                desired,
                energy.storage,
                energy.rate,
            )


def rehearse(
    scenario: Scenario, duration: float, *, human: bool = True, autonomy: bool = True
) -> History:
    """Runs a scenario without ROS for a time [s]; see `Rehearsal`."""
    return Rehearsal(scenario, human, autonomy).run(duration)
