# SPDX-License-Identifier: Apache-2.0
"""Rehearsal: a run without ROS, equal to the lockstep run of the nodes to the last bit."""

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
    """Signals of a rehearsal, one row per tick.

    Attributes:
        t: Time, shape (ticks,) [s].
        q: Configuration, shape (ticks, nq).
        v: Velocity, shape (ticks, n).
        torque: Control torque, shape (ticks, n) [N or N m].
        x: Subtask values, shape (ticks, size).
        x_rate: Subtask velocities, shape (ticks, n).
        desired: Desired subtask values, shape (ticks, size).
        storage: Storage functions, shape (ticks, subtasks) [J].
        storage_rate: Time derivatives of the storage functions, shape (ticks, subtasks) [W].
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
    """Sources, controller and simulation of a scenario, stepped in one process without ROS.

    Args:
        scenario: Scenario to run.
        human: True to run the haptic device, if the scenario has one.
        autonomy: True to run the planner, if the scenario has one.

    Attributes:
        team: The robots.
        stack: Subtasks of the team.
        controller: Controller.
        simulation: Simulated team.
        link: Link between the operator's device and the team, or None.
    """

    def __init__(self, scenario: Scenario, human: bool = True, autonomy: bool = True) -> None:
        self.team = scenario.build_team()
        self.stack = scenario.build_stack(self.team)
        self.controller = scenario.build_controller(self.team, self.stack)
        self.simulation = scenario.build_simulation(self.team, self.stack)
        self._feedback_subtask: str | None = None
        self.link: BilateralLink | None = None
        self._sources: list[tuple[str, str, Announcer]] = []
        rate = scenario.general.rate
        if human and scenario.haptic:
            device = scenario.build_haptic(self.stack)
            self.link = device if isinstance(device, BilateralLink) else None
            self._sources.append((scenario.haptic.subtask, "human", Announcer(device, rate)))
            if scenario.haptic.hand_mass > 0.0:
                self._feedback_subtask = scenario.haptic.subtask
        if autonomy and scenario.planner:
            planner = scenario.build_planner(self.stack)
            self._sources.append((scenario.planner.subtask, "autonomy", Announcer(planner, rate)))
        for _, _, announcer in self._sources:
            announcer.reset(0.0)
        self._feedback: Array | None = None
        general = scenario.general
        self._telemetry_period = max(1, round(rate / general.telemetry_rate))
        self._has_sensor = np.array([name in general.force_sensors for name in self.team.names])
        self._wrenches = np.zeros((len(self.team.names), 6))

    @property
    def q(self) -> Array:
        """Configuration, shape (nq,), converted to joint positions and back, as in messages."""
        positions = self.team.joints_from_configuration(self.simulation.q)
        return self.team.configuration_from_joints(positions)

    def step(self) -> Tick:
        """Run one tick: sources, controller, simulation."""
        now = self.simulation.now
        for subtask, source, announcer in self._sources:
            inputs = self.controller.inputs[subtask].sources[source]
            feedback = self._feedback if source == "human" else None
            for stamp, reference in announcer.announce(now, feedback):
                if reference is not None:
                    inputs.receive(stamp / 1e9, reference, now)
        if self.controller.regulates_forces and self.simulation.tick % self._telemetry_period == 0:
            self._wrenches = self.simulation.external_wrenches() * self._has_sensor[:, None]
        wrenches = self._wrenches
        tick = self.controller.step(now, self.q, self.simulation.v, wrenches=wrenches)
        if self._feedback_subtask:
            part = self.stack.slices[self.stack.names.index(self._feedback_subtask)]
            self._feedback = tick.feedback[part]
        self.simulation.step(self.command(tick))
        return tick

    def command(self, tick: Tick) -> Array:
        """Return the applied torque, shape (n,); comparisons override it with another law's."""
        return tick.torque

    def energy(self, tick: Tick, wrenches: Array) -> Energy:
        """Return storage functions and rates of a tick, with tool wrenches of shape (N, 6)."""
        return self.controller.energy(tick, self.team.external_torque(tick.state, wrenches))

    def run(self, duration: float) -> History:
        """Run for a time [s] and return all signals."""
        ticks = round(duration * self.simulation.rate)
        rows = list(self._rows(ticks))
        return History(**{name: np.array([row[name] for row in rows]) for name in rows[0]})

    def _rows(self, ticks: int) -> Iterator[dict[str, object]]:
        """Run ticks and yield the signals of each, by the names of `History`."""
        for _ in range(ticks):
            now = self.simulation.now
            wrenches = self.simulation.external_wrenches()
            tick = self.step()
            energy = self.energy(tick, wrenches)
            desired = np.concatenate([led.reference.position for led in tick.led])
            yield {
                "t": now,
                "q": tick.state.q,
                "v": tick.state.v,
                "torque": tick.torque,
                "x": tick.task.x,
                "x_rate": tick.x_rate,
                "desired": desired,
                "storage": energy.storage,
                "storage_rate": energy.rate,
            }


def rehearse(
    scenario: Scenario, duration: float, *, human: bool = True, autonomy: bool = True
) -> History:
    """Run a scenario without ROS for a time [s]; see `Rehearsal`."""
    return Rehearsal(scenario, human, autonomy).run(duration)
