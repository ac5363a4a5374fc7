# SPDX-License-Identifier: Apache-2.0
"""Simulated robot team: integration of (2) under control and external torques."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.clock import seconds, tick_stamp
from noninteract_ros.simulation.integrator import runge_kutta_step
from noninteract_ros.simulation.plant import Plant
from noninteract_ros.simulation.push import RESOLUTION, LivePush, Push, ScheduledPush
from noninteract_ros.simulation.subtask_object import SubtaskObject


@dataclass(frozen=True)
class EnergyBalance:
    """Stored energy of a simulation, and the work and losses since the start [J].

    Without an object at subtask level, controls + pushes = stored - stored at the start + lost, up
    to the integrator's error.

    Attributes:
        stored: Kinetic energy, and potential energy in gravity and in all couplings.
        controls: Work of the control torques.
        pushes: Work of all pushes and of the object at subtask level.
        lost: Energy dissipated in friction and couplings.
    """

    stored: float
    controls: float
    pushes: float
    lost: float


class TeamSimulation:
    """Simulation of a team with its environment and pushes.

    The torque is held over a tick; external torques and friction follow the state inside it. The
    integrator is the classical Runge-Kutta method of order 4.

    Args:
        plant: The team with all passive bodies and couplings.
        rate: Ticks per second [Hz].
        held: Object at subtask level held by the team, or None.
        pushes: Pushes of the scenario.

    Attributes:
        tick: Count of ticks since the start; time is tick / rate.
        torque: Control torque of the last tick, shape (n,).
    """

    def __init__(
        self,
        plant: Plant,
        rate: float,
        held: SubtaskObject | None = None,
        pushes: Sequence[ScheduledPush] = (),
    ) -> None:
        self.plant, self.team, self.rate = plant, plant.team, rate
        self._held = held
        self._scheduled = [(push, push.frame_name(plant.team)) for push in pushes]
        self._live: dict[str, LivePush] = {}
        self.tick = 0
        self._q: Array
        self._v: Array
        self.reset()

    @property
    def now(self) -> float:
        """Time since the start [s]."""
        return seconds(tick_stamp(self.tick, self.rate))

    @property
    def q(self) -> Array:
        """Configuration of the team, shape (nq,)."""
        return self._q[: len(self.team.q0)]

    @q.setter
    def q(self, value: Array) -> None:
        self._q = np.concatenate([value, self._q[len(self.team.q0) :]])

    @property
    def v(self) -> Array:
        """Velocity of the team, shape (n,)."""
        return self._v[: self.team.n]

    @v.setter
    def v(self, value: Array) -> None:
        self._v = np.concatenate([value, self._v[self.team.n :]])

    @property
    def plant_q(self) -> Array:
        """Configuration of the team and of all bodies, in the order of the plant's model."""
        return self._q

    def reset(self) -> None:
        """Reset all coordinates to the initial state, at rest; time continues."""
        self._q, self._v = self.plant.q0.copy(), np.zeros(self.plant.model.nv)
        self.torque = np.zeros(self.team.n)
        self._work = np.zeros(3)
        self._live.clear()

    def push(self, robot: str, wrench: Array, in_tool_axes: bool, duration: float) -> None:
        """Push the tool of a robot for a duration; replace its previous push.

        Args:
            robot: Name of the robot.
            wrench: Force and torque on the tool point, shape (6,) [N, N m].
            in_tool_axes: True if the wrench is in tool axes instead of world axes.
            duration: Time after which the push expires [s].
        """
        tool = f"{robot}/{self.team.robots[self.team.index(robot)].tool_frame}"
        push = Push(tool, wrench, in_tool_axes)
        self._live[robot] = LivePush(push, self.now + duration - RESOLUTION)

    def step(self, torque: Array | None) -> None:
        """Advance by one tick under a control torque, shape (n,); None brakes the team.

        The brake is a damping torque plus gravity compensation.
        """
        pushes = self._active_pushes()

        def applied(q: Array, v: Array) -> Array:
            if torque is not None:
                return torque
            return self.team.gravity(q) - self.team.brake_damping * v

        def derivative(q: Array, v: Array) -> tuple[Array, Array]:
            return self._derivative(q, v, applied(self._team_part(q), v[: self.team.n]), pushes)

        self.torque = applied(self.q, self.v)
        step = 1.0 / self.rate
        self._q, self._v, work = runge_kutta_step(self.plant, derivative, self._q, self._v, step)
        self._work += work
        self.tick += 1
        if self._live:
            self._live = {name: live for name, live in self._live.items() if live.until > self.now}

    def _active_pushes(self) -> list[Push]:
        """Return the pushes of the tick that starts now."""
        pushes = [live.push for live in self._live.values()]
        for scheduled, frame in self._scheduled:
            wrench = scheduled.wrench(self.now)
            if wrench.any():
                pushes.append(Push(frame, wrench))
        return pushes

    def _team_part(self, q: Array) -> Array:
        return q[: len(self.team.q0)]

    def _derivative(
        self, q: Array, v: Array, torque: Array, pushes: list[Push]
    ) -> tuple[Array, Array]:
        """Return the acceleration of the plant, and the powers of controls, pushes and losses."""
        n = self.team.n
        external = self.plant.external_loads(q, v, pushes)
        resistance = self.plant.friction * v
        load = external.coupling_torque + external.push_torque - resistance
        load[:n] += torque
        lost = float(resistance @ v) + sum(effect.dissipated for effect in external.effects)
        pushed = float(external.push_torque @ v)
        if self._held is None:
            acceleration = self.plant.acceleration(q, v, load)
        else:
            acceleration, holding = self._held.acceleration(self.team.state(q, v), load)
            pushed += float(holding @ v)
        return acceleration, np.array([float(torque @ v[:n]), pushed, lost])

    def external_wrenches(self) -> Array:
        """Return the external wrench on each tool under the last control torque, shape (N, 6).

        Wrenches are in world axes, at the tool point [N, N m]. The load of an object at subtask
        level is reported as the smallest wrench on each tool with the same joint torque.
        """
        q, v, pushes = self._q, self._v, self._active_pushes()
        wrenches = self.plant.tool_wrenches(q, v, pushes)
        if self._held is not None:
            external = self.plant.external_loads(q, v, pushes)
            load = external.coupling_torque + external.push_torque - self.plant.friction * v
            state = self.team.state(q, v)
            _, holding = self._held.acceleration(state, load + self.torque)
            wrenches += self.team.tool_wrenches(state, holding)
        return wrenches

    def energy(self) -> EnergyBalance:
        """Return the energy balance since the start or the last reset."""
        stored = self.plant.mechanical_energy(self._q, self._v)
        effects = self.plant.external_loads(self._q, self._v).effects
        stored += sum(effect.potential for effect in effects)
        return EnergyBalance(stored, *self._work.tolist())
