# SPDX-License-Identifier: Apache-2.0
"""The controller of a team, without ROS: states and inputs in, torques and accounts out."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.decoupling import (
    TaskDynamics,
    TaskError,
    commanded_acceleration,
)
from noninteract_ros.control.energy import Energy, energy
from noninteract_ros.control.impedance import ImpedanceSettings, stack_impedance
from noninteract_ros.control.joint_safety import JointSafety
from noninteract_ros.control.safety_settings import SafetySettings
from noninteract_ros.control.singularity import SingularityGuard, best_regularity
from noninteract_ros.control.structure import Structure
from noninteract_ros.control.subtask_input import InputSettings, Led, SubtaskInput
from noninteract_ros.control.team_view import DenseView, Seen, TeamView
from noninteract_ros.control.tick import Mode, Tick
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team

DEFAULT_SAFETY = SafetySettings()
JUMP = 0.1  # [m or rad] a coordinate that is this much further than it can have come was put there


class TeamController:
    """Leads a team's subtasks: decoupling, impedance, authority, bumpless changes.

    Args:
        team: The robots.
        stack: Their subtasks.
        law: One of `decoupling.LAWS`.
        impedances: Gains, by subtask in the stack's order.
        inputs: Authority, timeouts and limits, in the same order.
        transition_time: How long a change of law or gains fades in [s].
        stop_rate: Decay rate of the velocity after a stop [1/s].
        state_timeout: Gap between states after which every subtask starts anew [s].
        safety: Behaviour at singularities and joint limits.
    """

    def __init__(
        self,
        team: Team,
        stack: SubtaskStack,
        law: str,
        impedances: Sequence[ImpedanceSettings],
        inputs: Sequence[InputSettings],
        transition_time: float = 0.2,
        stop_rate: float = 10.0,
        state_timeout: float = 0.2,
        safety: SafetySettings = DEFAULT_SAFETY,
    ) -> None:
        self.team, self.stack = team, stack
        self._settings = list(impedances)
        self.inputs: Mapping[str, SubtaskInput] = {
            task.name: SubtaskInput(task, settings)
            for task, settings in zip(stack.subtasks, inputs, strict=True)
        }
        self._mode = Mode(law, stack_impedance(stack.subtasks, impedances))
        self._left: Mode | None = None
        self._transition_time, self._stop_rate = transition_time, stop_rate
        self._state_timeout = state_timeout
        self._bump, self._bump_start = np.zeros(team.n), -np.inf
        self._last: tuple[float, Array] | None = None
        self._view: TeamView = Structure.of(team, stack) or DenseView(team, stack)
        self._guard = SingularityGuard(team, safety, best_regularity(team, stack))
        self._safety = JointSafety(team, safety)

    @property
    def mode(self) -> Mode:
        """Law, gains and stop in force."""
        return self._mode

    def set_law(self, law: str) -> None:
        """Changes the law without a bump."""
        self._change(replace(self._mode, law=law))

    def set_impedance(self, subtask: str, settings: ImpedanceSettings) -> None:
        """Changes one subtask's gains without a bump.

        Raises:
            ScenarioError: The gains do not fit the subtask; nothing is changed.
        """
        changed = list(self._settings)
        changed[self.stack.names.index(subtask)] = settings
        self._change(replace(self._mode, impedance=stack_impedance(self.stack.subtasks, changed)))
        self._settings = changed

    def set_authority(self, subtask: str, authority: str) -> None:
        """Hands one subtask to another source without a bump."""
        self.inputs[subtask].authority = authority

    def stop(self) -> None:
        """Damps the team to rest and ignores every input until `resume`."""
        self._change(replace(self._mode, stopped=True))

    def resume(self) -> None:
        """Leaves a stop: every subtask holds where it is until it hears from its source."""
        for item in self.inputs.values():
            item.forget()
        self._change(replace(self._mode, stopped=False))

    def reset(self) -> None:
        """Forgets the past, as when the team's clock starts anew; law, gains and a stop remain."""
        self._last = None
        self._bump_start = -np.inf
        self._guard.reset()
        self._safety.reset()
        for item in self.inputs.values():
            item.reset()

    def _change(self, mode: Mode) -> None:
        self._left = self._left or self._mode
        self._mode = mode

    def step(self, now: float, q: Array, v: Array) -> Tick:
        """Torque for the time from `now` to the next tick.

        Args:
            now: Time of the state [s]; later than at the last step.
            q: Configuration, shape (nq,).
            v: Velocity, shape (n,).
        """
        seen = self._view.evaluate(q, v, self._mode.impedance.inertias)
        state, task, dynamics = seen.state, seen.task, seen.dynamics
        restarted = self._restart_reason(now, q, v)
        elapsed = 0.0 if self._last is None else now - self._last[0]
        step = 0.0 if restarted else elapsed
        # At the tick of a stop the inputs still count, so that the torque starts without a step.
        stopped = self._mode.stopped and (self._left is None or self._left.stopped)
        if restarted or stopped or (self._left and self._left.stopped):
            self._rest_at(task.x)
        if restarted:
            self._guard.reset()
        led = tuple(
            item.resting(now) if stopped else item.advance(now, step)
            for item in self.inputs.values()
        )
        error = self._error(seen, led)
        relative = self._guard.relative(dynamics.inverse_sizes)
        share = self._guard.law_share(relative)
        recovery = self._guard.recovery(q, v, share, self._mode.stopped, step)
        acceleration, wanted = self._blended(now, seen, error, share, recovery)
        asked = self.team.inverse_dynamics(q, v, wanted)
        torque, safety = self._safety.protect(q, v, asked, state.g, elapsed)
        self._last = (now, q)
        x_rate = error.e_rate + error.reference_velocity
        feedback = self._mode.impedance.damping * error.e_rate + self._mode.impedance.force(
            error.e
        )
        return Tick(
            torque,
            state,
            task,
            x_rate,
            error,
            led,
            dynamics,
            acceleration,
            feedback,
            share,
            relative,
            torque - asked,
            safety,
            restarted,
        )

    def energy(self, tick: Tick, external_torque: Array) -> Energy:
        """Storage functions (32) and their rates (33) of a tick.

        What the limits of the joints add to the torque acts on the subtasks as if from outside.

        Args:
            tick: What `step` returned.
            external_torque: tau_e on the joints, shape (n,) [N or N m].
        """
        return energy(
            tick.dynamics,
            tick.error,
            self._mode.impedance,
            tick.task_acceleration,
            external_torque + tick.added_torque,
        )

    def _restart_reason(self, now: float, q: Array, v: Array) -> str:
        if self._last is None:
            return "the first state"
        last, q_last = self._last
        if now - last > self._state_timeout:
            return f"no state for {now - last:.3f} s"
        moved = np.abs(self.team.difference(q_last, q))
        if (moved > JUMP + 2.0 * np.abs(v) * (now - last)).any():
            joint = self.team.joint_names[int(moved.argmax())]
            return f"{joint} jumped by {moved.max():.3f}"
        return ""

    def _rest_at(self, x: Array) -> None:
        for item, part in zip(self.inputs.values(), self.stack.value_slices, strict=True):
            item.rest_at(x[part])

    def _blended(
        self, now: float, seen: Seen, error: TaskError, share: float, recovery: Array
    ) -> tuple[Array, Array]:
        """Task and joint acceleration of law and recovery together, shape (n,) each."""
        dynamics, v = seen.dynamics, seen.state.v
        if share == 0.0:  # The law is not even defined at a singularity; what fades starts over.
            self._left, self._bump_start = None, -np.inf
            return dynamics.acceleration_of(v, recovery), recovery
        acceleration = self._acceleration(now, seen, error)
        wanted = dynamics.joint_acceleration(v, acceleration)
        if share == 1.0:
            return acceleration, wanted
        wanted = share * wanted + (1.0 - share) * recovery
        return dynamics.acceleration_of(v, wanted), wanted

    def _acceleration(self, now: float, seen: Seen, error: TaskError) -> Array:
        """Task acceleration in force, with the bump of the last change fading out."""
        v = seen.state.v
        wanted = self._wanted(self._mode, v, error, seen.dynamics)
        if self._left is not None:
            left = self._view.again(seen, self._left.impedance.inertias)
            before = self._wanted(self._left, v, error, left) + self._fading(now)
            self._bump, self._bump_start, self._left = before - wanted, now, None
        return wanted + self._fading(now)

    def _fading(self, now: float) -> Array:
        progress = (now - self._bump_start) / self._transition_time
        if progress >= 1.0:
            return np.zeros_like(self._bump)
        return self._bump * (1.0 - progress) ** 2 * (1.0 + 2.0 * progress)

    def _wanted(self, mode: Mode, v: Array, error: TaskError, dynamics: TaskDynamics) -> Array:
        if mode.stopped:
            return dynamics.acceleration_of(v, -self._stop_rate * v)
        return commanded_acceleration(mode.law, dynamics, error, mode.impedance)

    def _error(self, seen: Seen, led: Sequence[Led]) -> TaskError:
        position = np.concatenate([item.reference.position for item in led])
        velocity = np.concatenate([item.reference.velocity for item in led])
        acceleration = np.concatenate([item.reference.acceleration for item in led])
        force = np.concatenate([item.force for item in led])
        e = self.stack.difference(seen.task.x, position)
        e_rate = seen.dynamics.velocity(seen.state.v) - velocity
        return TaskError(e, e_rate, velocity, acceleration, force)
