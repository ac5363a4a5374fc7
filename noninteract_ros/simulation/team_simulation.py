# SPDX-License-Identifier: Apache-2.0
"""A simulated robot team: integrates (2) under control and external torques."""

from collections.abc import Sequence

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.clock import seconds, tick_stamp
from noninteract_ros.simulation.integrator import runge_kutta_step
from noninteract_ros.simulation.push import RESOLUTION, LivePush, ScheduledPush
from noninteract_ros.simulation.subtask_object import SubtaskObject
from noninteract_ros.team.team import Team


class TeamSimulation:
    """The team, what it holds and who pushes it.

    The torque is held over a tick, external torques and the joints' friction follow the state
    inside it; the method is the classical Runge-Kutta one, order 4.

    Args:
        team: The robots.
        rate: Ticks per second [Hz].
        held: Object that the team holds, or None.
        pushes: Pushes of the scenario.

    Attributes:
        tick: Number of ticks since the start; time is tick / rate.
        q: Configuration, shape (nq,).
        v: Velocity, shape (n,).
        torque: Control torque of the last tick, shape (n,).
    """

    def __init__(
        self,
        team: Team,
        rate: float,
        held: SubtaskObject | None = None,
        pushes: Sequence[ScheduledPush] = (),
    ) -> None:
        self.team, self.rate = team, rate
        self._held, self._pushes = held, tuple(pushes)
        self._live: dict[str, LivePush] = {}
        self.tick = 0
        self.reset()

    @property
    def now(self) -> float:
        """Time since the start [s]."""
        return seconds(tick_stamp(self.tick, self.rate))

    def reset(self) -> None:
        """Puts the team back to its initial state, at rest; time goes on."""
        self.q, self.v = self.team.q0.copy(), np.zeros(self.team.n)
        self.torque = np.zeros(self.team.n)
        self._live.clear()

    def push(self, robot: str, wrench: Array, in_tool_axes: bool, duration: float) -> None:
        """Pushes a robot for a while; a new push replaces its last one.

        Args:
            robot: Name of the robot.
            wrench: Force and torque on the tool point, shape (6,) [N, N m].
            in_tool_axes: Whether the wrench is given in tool axes instead of world axes.
            duration: Time after which it lapses [s].
        """
        self._live[robot] = LivePush(wrench, in_tool_axes, self.now + duration - RESOLUTION)

    def step(self, torque: Array | None) -> None:
        """One tick under a control torque, shape (n,); None brakes by damping and gravity."""
        pushed = self._push_wrenches(self.q).any()
        still = self._held is None and not pushed

        def applied(q: Array, v: Array) -> Array:
            if torque is not None:
                return torque
            return self.team.gravity(q) - self.team.brake_damping * v

        def acceleration(q: Array, v: Array) -> Array:
            if still:
                return self.team.forward_dynamics(q, v, self._rubbed(v, applied(q, v)))
            return self._loaded_acceleration(q, v, applied(q, v))

        self.torque = applied(self.q, self.v)
        integrate = self.team.integrate
        self.q, self.v = runge_kutta_step(integrate, acceleration, self.q, self.v, 1 / self.rate)
        self.tick += 1
        self._live = {name: push for name, push in self._live.items() if push.until > self.now}

    def _rubbed(self, v: Array, torque: Array) -> Array:
        """What viscous friction leaves of a torque, shape (n,) [N or N m]."""
        return torque - self.team.friction * v

    def _push_wrenches(self, q: Array) -> Array:
        """Pushes on each tool of a team at q now, world axes, shape (N, 6) [N, N m]."""
        wrenches = np.zeros((len(self.team.names), 6))
        for push in self._pushes:
            wrenches[self.team.index(push.robot)] += push.wrench(self.now)
        if self._live:
            rotations = self.team.tool_rotations(q)
        for name, live in self._live.items():
            i = self.team.index(name)
            R = rotations[i] if live.in_tool_axes else np.eye(3)
            wrenches[i] += np.concatenate([R @ live.wrench[:3], R @ live.wrench[3:]])
        return wrenches

    def _loaded_acceleration(self, q: Array, v: Array, torque: Array) -> Array:
        """Acceleration with everything that acts from outside; the object's mass is implicit."""
        pushes = self._push_wrenches(q)
        state = self.team.state(q, v)
        load = self._rubbed(v, torque) - state.C @ v - state.g
        total = load + self.team.external_torque(state, pushes)
        if self._held is None:
            return np.linalg.solve(state.M, total)
        A, b = self._held.torque_terms(state)
        return np.linalg.solve(state.M - A, total + b)

    def external_wrenches(self) -> Array:
        """What acts on each tool from outside, under the last control torque, shape (N, 6).

        World axes, at the tool point [N, N m]. What the object exerts is reported as the smallest
        wrench on each tool that has its joint torque.
        """
        wrenches = self._push_wrenches(self.q)
        if self._held is None:
            return wrenches
        state = self.team.state(self.q, self.v)
        acceleration = self._loaded_acceleration(self.q, self.v, self.torque)
        A, b = self._held.torque_terms(state)
        return wrenches + self.team.tool_wrenches(state, A @ acceleration + b)
