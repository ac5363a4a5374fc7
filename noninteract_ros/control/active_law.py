# SPDX-License-Identifier: Apache-2.0
"""The acceleration that is asked for: of the law in force, of the one before it, of a recovery."""

from dataclasses import replace

from noninteract_ros.arrays import Array
from noninteract_ros.control.energy.gate import GATED, EnergyGate, TickTerms
from noninteract_ros.control.law.decoupling import acceleration_against
from noninteract_ros.control.law.force_goal import ForceGoals
from noninteract_ros.control.law.gated_law import decoupling, gated_acceleration
from noninteract_ros.control.law.team_dynamics import Evaluation, TeamEvaluator
from noninteract_ros.control.safety.fade import Fade
from noninteract_ros.control.safety.joint_limits import SafetyReport
from noninteract_ros.control.safety.stop import Stop
from noninteract_ros.control.tick import Mode


class ActiveLaw:
    """Evaluates modes at a state, so that a change of mode has no bump.

    Args:
        gate: The energy account with its gates.
        goals: Forces that subtasks are to press with.
        transition_time: How long a change fades in [s].
        stop: What brings a stopped team to rest.

    Attributes:
        left: Mode that a change has left since the last tick, or None.
    """

    def __init__(
        self, gate: EnergyGate, goals: ForceGoals, transition_time: float, stop: Stop
    ) -> None:
        self._gate, self._goals = gate, goals
        self._transition_time = transition_time
        self._fade, self._stop = Fade(), stop
        self.left: Mode | None = None

    def forget(self) -> None:
        """The team's clock starts anew: nothing fades any more."""
        self._fade.forget()
        self._stop.forget()

    def changing(self, now: float) -> bool:
        """Whether something is left of a change of mode at a time [s]."""
        return self.left is not None or self._fade.active(now)

    def blended(
        self,
        mode: Mode,
        view: TeamEvaluator,
        seen: Evaluation,
        moment: TickTerms,
        share: float,
        recovery: Array,
    ) -> tuple[Array, Array]:
        """Task and joint acceleration of law and recovery together, shape (n,) each.

        Args:
            mode: Mode in force.
            view: Evaluates the state with other desired inertias.
            seen: The state.
            moment: The same as the law sees it.
            share: Share of the law.
            recovery: Joint acceleration of the recovery from a singularity, shape (n,).
        """
        dynamics, v = seen.dynamics, seen.state.v
        if mode.stopped and self.left is not None and not self.left.stopped:
            self._stop.begin(moment.now, dynamics.velocity(v))
        if share == 0.0:  # The law is not even defined at a singularity; what fades starts over.
            self.left = None
            self._fade.forget()
            return dynamics.acceleration_of(v, recovery), recovery
        acceleration = self._acceleration(mode, view, seen, moment)
        wanted = dynamics.joint_acceleration(v, acceleration)
        if share == 1.0:
            return acceleration, wanted
        wanted = share * wanted + (1.0 - share) * recovery
        return dynamics.acceleration_of(v, wanted), wanted

    def _acceleration(
        self, mode: Mode, view: TeamEvaluator, seen: Evaluation, moment: TickTerms
    ) -> Array:
        """Task acceleration in force, with the bump of the last change fading out."""
        v, now = seen.state.v, moment.now
        wanted = self._wanted(mode, v, moment)
        if self.left is not None:
            impedance = self.left.impedance
            dynamics = view.again(seen, impedance.inertias)
            error = replace(moment.error, goal=self._goals.wanted(impedance))
            added = decoupling(dynamics, error, impedance)
            was = replace(moment, error=error, dynamics=dynamics, impedance=impedance, added=added)
            before = self._wanted(self.left, v, was)
            self._fade.begin(now, self._fade.added_to(before, now) - wanted, self._fading(mode))
            self.left = None
        return self._fade.added_to(wanted, now)

    def _fading(self, mode: Mode) -> float:
        """How long what was in force before a change fades out [s]."""
        # An acceleration of before must not lead a team on that is to come to rest.
        shorter = self._stop.ramp_time if mode.stopped else self._transition_time
        return min(shorter, self._transition_time)

    def _wanted(self, mode: Mode, v: Array, moment: TickTerms) -> Array:
        """What a mode asks for by itself."""
        dynamics, error, added = moment.dynamics, moment.error, moment.added
        if mode.stopped:
            return dynamics.acceleration_of(v, -self._stop.damping(moment.now) * v)
        if mode.law == GATED:
            tank = self._gate.tank
            return gated_acceleration(dynamics, error, added, tank.sigma, tank.grip)
        if mode.law == "noninteracting":
            return added.acceleration
        return acceleration_against(mode.law, dynamics, error, added.feedback)

    def remember(
        self,
        mode: Mode,
        moment: TickTerms,
        torque: Array,
        acceleration: Array,
        share: float,
        safety: SafetyReport,
    ) -> None:
        """Tells the account what the torque of a tick is made of.

        Args:
            mode: Mode in force.
            moment: The tick.
            torque: Torque as sent, shape (n,) [N or N m].
            acceleration: Task acceleration that was asked for, shape (n,).
            share: Share of the law in it.
            safety: What the limits of the joints made of it.
        """
        if share < 1.0 or not safety.finite:
            self._gate.pause()  # It is another law's, which has no such account.
        elif mode.stopped:
            self._gate.remember_damping(moment, torque)
        else:
            self._gate.remember(moment, torque, acceleration, not safety.cut)
