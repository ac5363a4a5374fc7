# SPDX-License-Identifier: Apache-2.0
"""Controller of a team, without ROS: states and inputs in, torques and accounts out."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.active_law import ActiveLaw
from noninteract_ros.control.energy.command_log import with_paid
from noninteract_ros.control.energy.external_torque import ExternalTorque
from noninteract_ros.control.energy.gate import GATED, SIGMAS, EnergyGate, TickTerms
from noninteract_ros.control.energy.stiffness_ramp import StiffnessRamp
from noninteract_ros.control.energy.storage import Energy, energy
from noninteract_ros.control.energy.tank import TankSettings, affordable
from noninteract_ros.control.evaluator import make_evaluator
from noninteract_ros.control.fast.compiled_layout import CompiledLayout
from noninteract_ros.control.law.decoupling import TaskError
from noninteract_ros.control.law.force_goal import ForceGoals
from noninteract_ros.control.law.gated_law import decoupling, without_decoupling
from noninteract_ros.control.law.impedance import ImpedanceSettings, stack_impedance
from noninteract_ros.control.law.team_dynamics import Evaluation, TeamEvaluator
from noninteract_ros.control.references.subtask_input import (
    InputSettings,
    SubtaskCommand,
    SubtaskInput,
)
from noninteract_ros.control.safety.continuity import Continuity
from noninteract_ros.control.safety.joint_limits import JointMargins
from noninteract_ros.control.safety.settings import SafetySettings
from noninteract_ros.control.safety.singularity import SingularityGuard, best_regularity
from noninteract_ros.control.safety.singularity_escape import SingularityEscape
from noninteract_ros.control.safety.stop import Stop
from noninteract_ros.control.safety.torque_limiter import TorqueLimiter
from noninteract_ros.control.tick import Mode, Tick
from noninteract_ros.control.walls.wall_guard import WallGuard
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team

if TYPE_CHECKING:
    from noninteract_ros.control.walls.walls import Walls

DEFAULT_SAFETY, DEFAULT_TANK = SafetySettings(), TankSettings()


class TeamController:
    """Control of a team's subtasks: decoupling, impedance, authority, bumpless changes.

    Args:
        team: The robots.
        stack: Their subtasks.
        law: One of `decoupling.LAWS`.
        impedances: Gains, by subtask in the stack's order.
        inputs: Authority, timeouts and limits, in the same order.
        transition_time: Time in which a change of law or gains fades [s].
        stop_rate: Decay rate of fast motions after a stop, once it is in full force [1/s].
        state_timeout: Gap between states after which every subtask holds anew [s].
        safety: Behaviour at singularities and joint limits.
        tank: Capacity, levels and rates of the energy account.
        measured: True where wrenches on the tools will be given; else a momentum observer
            estimates the external torque.
        walls: Constraints that joints and bodies keep, or None.
    """

    def __init__(
        self,
        team: Team,
        stack: SubtaskStack,
        law: str,
        impedances: Sequence[ImpedanceSettings],
        inputs: Sequence[InputSettings],
        transition_time: float = 0.2,
        stop_rate: float = 30.0,
        state_timeout: float = 0.2,
        safety: SafetySettings = DEFAULT_SAFETY,
        tank: TankSettings = DEFAULT_TANK,
        measured: bool = True,
        walls: "Walls | None" = None,
    ) -> None:
        self.team, self.stack = team, stack
        self._layout = CompiledLayout(stack.layout)
        self._settings = list(impedances)
        self.inputs: Mapping[str, SubtaskInput] = {
            task.name: SubtaskInput(task, settings)
            for task, settings in zip(stack.subtasks, inputs, strict=True)
        }
        self._mode = Mode(law, stack_impedance(stack.subtasks, impedances))
        self._continuity = Continuity(team, state_timeout)
        self.gate = EnergyGate(team, stack, tank)
        self.external = ExternalTorque(team, measured, tank.observer_gain)
        self._springs, self._goals = StiffnessRamp(transition_time), ForceGoals(team.n)
        max_jerk = np.concatenate([item.max_jerk for item in self.inputs.values()])
        self._law = ActiveLaw(self.gate, self._goals, transition_time, Stop(stop_rate, max_jerk))
        best = best_regularity(team, stack)
        escape = SingularityEscape(team, stack, best, safety.singularity_begin)
        self._guard = SingularityGuard(team, safety, best, escape)
        self._margins, self._limiter = JointMargins(team, safety), TorqueLimiter(team, safety)
        self._onset: Array = np.zeros(team.n)
        self._walls = WallGuard(team, stack, walls, tank.observer_gain) if walls else None

    @cached_property
    def _view(self) -> TeamEvaluator:
        """Evaluator of states."""
        return make_evaluator(self.team, self.stack)

    def prepare(self) -> None:
        """Compile everything that a step needs; otherwise the first step does."""
        self._layout.prepare()
        _ = self._view

    @property
    def mode(self) -> Mode:
        """Law, gains and stop in force."""
        return self._mode

    def set_law(self, law: str) -> None:
        """Change the law without a bump; the account goes on."""
        self._change(replace(self._mode, law=law))

    def set_impedance(self, subtask: str, settings: ImpedanceSettings) -> None:
        """Change one subtask's gains without a bump.

        Raises:
            ScenarioError: The gains do not fit the subtask; nothing is changed.
        """
        changed = list(self._settings)
        changed[self.stack.names.index(subtask)] = settings
        impedance = stack_impedance(self.stack.subtasks, changed)
        self._springs.reset()
        if self._mode.law == GATED:
            impedance = self._springs.begin(self._mode.impedance, impedance)
        self._change(replace(self._mode, impedance=impedance))
        self._settings = changed

    @property
    def regulates_forces(self) -> bool:
        """True where a force is regulated, so that each step needs the external one."""
        return bool(self._mode.impedance.goal_gain.any())

    @property
    def springs_waiting(self) -> float | None:
        """Progress of a change of stiffness that waits for energy, 0 to 1; None without any."""
        return self._springs.waiting

    def set_authority(self, subtask: str, authority: str) -> None:
        """Hand one subtask to another source without a bump."""
        self.inputs[subtask].authority = authority

    def stop(self) -> None:
        """Damp the team to rest and ignore every input until `resume`."""
        self._change(replace(self._mode, stopped=True))

    def resume(self) -> None:
        """End a stop: every subtask holds where it is until its source sends again."""
        self._discard_inputs()
        self._change(replace(self._mode, stopped=False))

    def reset(self) -> None:
        """Begin another life, as when the team's clock starts anew.

        Law, gains and a stop remain.
        """
        self._continuity.reset()
        self._law.reset()
        self.gate.reset()
        self._limiter.reset()
        for item in self.inputs.values():
            item.reset()

    def reset_state(self) -> None:
        """Begin anew at the next state while the team's time goes on; subtasks hold until led.

        The account goes on as well: a team that is moved by hand has earned nothing.
        """
        self._continuity.interrupt()
        self._law.reset()  # What still fades would push the team from where it was reset to.
        self.gate.interrupt()
        self._discard_inputs()

    def _discard_inputs(self) -> None:
        for item in self.inputs.values():
            item.discard_inputs()

    def _change(self, mode: Mode) -> None:
        self._law.previous = self._law.previous or self._mode
        self._mode = mode

    def step(
        self,
        now: float,
        q: Array,
        v: Array,
        applied: Array | None = None,
        wrenches: Array | None = None,
    ) -> Tick:
        """Return the torque from `now` to the next tick, with all results.

        Args:
            now: Time of the state [s]; later than at the last step.
            q: Configuration, shape (nq,).
            v: Velocity, shape (n,).
            applied: Torque that the team reports to have had until now, shape (n,); None, if it
                was the last one that was asked for.
            wrenches: On the tools, as far as they are measured, shape (N, 6) [N, N m].
        """
        seen = self._view.evaluate(q, v, self._mode.impedance.inertias)
        restarted = self._continuity.broken(now, q, v)
        elapsed = self._continuity.elapsed(now)
        step = 0.0 if restarted else elapsed
        # At the tick of a stop the inputs still count, so that the torque starts without a step.
        previous = self._law.previous
        stopped = self._mode.stopped and (previous is None or previous.stopped)
        # During a singularity escape the subtasks must not hold singular values.
        searching = self._guard.searching
        if restarted or stopped or searching or (previous and previous.stopped):
            self._rest_at(seen.task.x)
        if restarted:
            self._guard.reset()
            self._goals.reset()
            self.external.reset()
            if self._walls:
                self._walls.reset()
            self.gate.interrupt()
        led = tuple(
            item.hold(now) if stopped else item.advance(now, step) for item in self.inputs.values()
        )
        regular = self._guard.relative(seen.dynamics.inverse_sizes)
        relative = min(regular, self.stack.singularity_distance(seen.state))
        share = self._guard.law_share(relative)
        self.external.update(step, q, v, applied)
        if self._walls:
            self._walls.update(step, seen, applied)
            led = self._walls.governed(led, self._mode.stopped, share == 1.0)
        changing = self._law.changing(now) or self._springs.changing
        depth = self._margins.depth(q)
        size = np.abs(depth)
        self._onset = size if restarted else np.minimum(self._onset, size)
        terms = self._terms(now, seen, led, share, step, depth)
        self.gate.book(terms, self._mode.law, applied)
        self._deepen(depth, step)
        if share < 1.0:  # Springs yield as a whole, so that nothing snaps through a singularity.
            self.gate.loosen(share * self.gate.tank.nu)
        guard = self._margins.at(depth, v, self._onset)
        pull = self._guard.pull(q, share, self._mode.stopped, step)
        self._law.escaping = self._guard.searching
        asked, acceleration = self._law.command(
            self._mode, self._view, seen, terms, pull, self._guard.damping(share)
        )
        if self._walls:
            sigma = SIGMAS.get(self._mode.law, self.gate.tank.sigma) * share
            passive, paid = self._walls.forces(asked.torque, 0.0 if self._mode.stopped else sigma)
            asked = with_paid(asked, paid)
            guard = guard.with_torque(passive)
        command, safety = self._limiter.limit(asked, terms, self.gate.tank, guard, elapsed)
        if safety.shares.springs < 1.0:
            self.gate.loosen(safety.shares.springs * self.gate.tank.nu)
        self.gate.record(command)
        torque = command.torque
        self._regulate(seen, wrenches, step, held=share < 1.0 or safety.acted)
        self._continuity.record(now, q)
        self.external.record(torque)
        if self._walls:
            self._walls.record(torque)
        return Tick(
            torque,
            seen.state,
            seen.task,
            terms.error.e_rate + terms.error.reference_velocity,
            terms.error,
            led,
            seen.dynamics,
            acceleration,
            terms.added.feedback,
            share,
            relative,
            torque - asked.torque,
            safety,
            restarted,
            self.gate.account,
            self._mode.law,
            bool(restarted) or self._mode.stopped or changing,
            self._walls.report() if self._walls else None,
        )

    def _deepen(self, depth: Array, step: float) -> None:
        """Have margins that found their joint inside reach further out, as the tank pays."""
        if not self._onset.any():
            return
        wanted = self._margins.deeper(self._onset, step)
        tank = self.gate.tank
        cost = self._margins.potential(depth, wanted) - tank.margins
        share = affordable(tank, cost, self.gate.levels)
        # V is convex in the onsets: a share of the change costs no more than the share.
        self._onset = self._onset + share * (wanted - self._onset)
        self.gate.deepen(self._margins.potential(depth, self._onset))

    def _regulate(self, seen: Evaluation, wrenches: Array | None, step: float, held: bool) -> None:
        """Integrate what is missing of the force goals, unless something holds the law back."""
        if not self.regulates_forces:
            return
        held = held or self._mode.stopped or self.gate.account.closing
        pressing = -seen.dynamics.force_of(self.external.torque(seen.state, wrenches))
        self._goals.advance(self._mode.impedance, pressing, step, held)

    def _terms(
        self,
        now: float,
        seen: Evaluation,
        led: Sequence[SubtaskCommand],
        share: float,
        step: float,
        depth: Array,
    ) -> TickTerms:
        """Return this tick as law and account use it, with a stiffness ramp one step further."""
        error = self._error(seen, led)
        tank = self.gate.tank if self._mode.law == GATED else None
        impedance = self._springs.advance(
            self._mode.impedance, error.e, step, tank, self.gate.levels
        )
        if impedance is not self._mode.impedance:
            self._mode = replace(self._mode, impedance=impedance)
        references = [item.reference for item in led]
        added = (decoupling if share > 0.0 else without_decoupling)(
            seen.dynamics, error, impedance
        )
        return TickTerms(
            now=now,
            q=seen.state.q,
            v=seen.state.v,
            x=seen.task.x,
            references=references,
            error=error,
            dynamics=seen.dynamics,
            impedance=impedance,
            added=added,
            share=share,
            margins=self._margins.potential(depth, self._onset) if depth.any() else 0.0,
        )

    def energy(self, tick: Tick, external_torque: Array) -> Energy:
        """Return storage functions (32) and their rates (33) of a tick.

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

    def _rest_at(self, x: Array) -> None:
        for item, part in zip(self.inputs.values(), self.stack.value_slices, strict=True):
            item.hold_at(x[part])

    def _error(self, seen: Evaluation, led: Sequence[SubtaskCommand]) -> TaskError:
        position = np.concatenate([item.reference.position for item in led])
        velocity = np.concatenate([item.reference.velocity for item in led])
        acceleration = np.concatenate([item.reference.acceleration for item in led])
        force = np.concatenate([item.force for item in led])
        e = self._layout.difference(seen.task.x, position)
        e_rate = seen.dynamics.velocity(seen.state.v) - velocity
        goal = self._goals.wanted(self._mode.impedance)
        return TaskError(e, e_rate, velocity, acceleration, force, goal)
