# SPDX-License-Identifier: Apache-2.0
"""The torque that is asked for: of the law in force, of the one before it, of a recovery."""

from dataclasses import replace

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.energy.command_log import Command, undivided
from noninteract_ros.control.energy.gate import GATED, EnergyGate, TickTerms
from noninteract_ros.control.law.decoupling import acceleration_against
from noninteract_ros.control.law.force_goal import ForceGoals
from noninteract_ros.control.law.gated_law import beyond_natural, decoupling, gated_acceleration
from noninteract_ros.control.law.team_dynamics import Evaluation, TeamEvaluator
from noninteract_ros.control.safety.fade import Fade
from noninteract_ros.control.safety.stop import Stop
from noninteract_ros.control.tick import Mode


class ActiveLaw:
    """Evaluates modes at a state, so that a change of mode has no bump.

    Where the Jacobian is regular a change fades as a task acceleration, elsewhere as a torque.

    Args:
        gate: The energy account with its gates.
        goals: Forces that subtasks are to press with.
        transition_time: Time in which a change fades [s].
        stop: Damping of a stopped team.

    Attributes:
        previous: Mode that a change has replaced since the last tick, or None.
        escaping: True while the team leaves a singularity in which it was found.
    """

    def __init__(
        self, gate: EnergyGate, goals: ForceGoals, transition_time: float, stop: Stop
    ) -> None:
        self._gate, self._goals = gate, goals
        self._transition_time = transition_time
        self._fade, self._torque_fade, self._stop = Fade(), Fade(), stop
        self.previous: Mode | None = None
        self.escaping = False

    def reset(self) -> None:
        """End all fades: the team's clock starts anew."""
        self._fade.reset()
        self._torque_fade.reset()
        self._stop.reset()

    def changing(self, now: float) -> bool:
        """Return True while something is left of a change of mode at a time [s]."""
        fading = self._fade.active(now) or self._torque_fade.active(now)
        return self.previous is not None or fading

    def command(
        self,
        mode: Mode,
        view: TeamEvaluator,
        seen: Evaluation,
        terms: TickTerms,
        pull: Array | None,
        damping: float,
    ) -> tuple[Command, Array]:
        """Return the torque that is asked for with its parts, and its task acceleration, (n,).

        Args:
            mode: Mode in force.
            view: Evaluates the state with other desired inertias.
            seen: The state.
            terms: The same as the law uses it.
            pull: Joint acceleration that leads out of a singularity, shape (n,), or None.
            damping: Rate at which the joints are damped beside the law [1/s].
        """
        dynamics, v, now = seen.dynamics, seen.state.v, terms.now
        if mode.stopped and self.previous is not None and not self.previous.stopped:
            self._stop.begin(now, dynamics.velocity(v))
        if terms.share < 1.0:
            return self._reduced_command(mode, view, seen, terms, pull, damping)
        acceleration = self._acceleration(mode, view, seen, terms)
        torque = dynamics.torque(v, dynamics.joint_acceleration(v, acceleration))
        command = self._parts(mode, terms, torque, acceleration)
        return self._with_torque_fade(command, now), acceleration

    def _acceleration(
        self, mode: Mode, view: TeamEvaluator, seen: Evaluation, terms: TickTerms
    ) -> Array:
        """Return the task acceleration in force, with the bump of the last change fading out."""
        v, now = seen.state.v, terms.now
        wanted = self._wanted(mode, v, terms)
        if self.previous is not None:
            before = self._wanted(self.previous, v, self._terms_before(view, seen, terms))
            self._fade.begin(now, self._fade.added_to(before, now) - wanted, self._fading(mode))
            self.previous = None
        return self._fade.added_to(wanted, now)

    def _terms_before(self, view: TeamEvaluator, seen: Evaluation, terms: TickTerms) -> TickTerms:
        """Return this tick as the previous mode uses it."""
        assert self.previous is not None
        impedance = self.previous.impedance
        dynamics = view.again(seen, impedance.inertias)
        error = replace(terms.error, goal=self._goals.wanted(impedance))
        added = decoupling(dynamics, error, impedance)
        return replace(terms, error=error, dynamics=dynamics, impedance=impedance, added=added)

    def _fading(self, mode: Mode) -> float:
        """Return the time in which what was in force before a change fades out [s]."""
        # An acceleration of before must not lead a team on that is to come to rest.
        shorter = self._stop.ramp_time if mode.stopped else self._transition_time
        return min(shorter, self._transition_time)

    def _wanted(self, mode: Mode, v: Array, terms: TickTerms) -> Array:
        """Return the task acceleration that a mode asks for by itself, shape (n,)."""
        dynamics, error, added = terms.dynamics, terms.error, terms.added
        if mode.stopped:
            return dynamics.acceleration_of(v, -self._stop.damping(terms.now) * v)
        if mode.law == GATED:
            tank = self._gate.tank
            gates = tank.sigma, tank.nu, tank.damping
            return gated_acceleration(dynamics, error, added, *gates)
        resistance = added.resistance(self._gate.tank.nu, self._gate.tank.damping)
        if mode.law == "noninteracting" and resistance is added.feedback:
            return added.acceleration
        return acceleration_against(mode.law, dynamics, error, resistance)

    def _parts(self, mode: Mode, terms: TickTerms, torque: Array, acceleration: Array) -> Command:
        """Return a torque at a regular state with what it is made of."""
        dynamics, error, added, tank = terms.dynamics, terms.error, terms.added, self._gate.tank
        if mode.stopped:
            return undivided(torque, dynamics)
        resistance = added.resistance(tank.nu, tank.damping)
        if acceleration is added.acceleration and resistance is added.feedback:
            force = added.force
        else:
            force = beyond_natural(dynamics, error, acceleration, added.drift + resistance)
        led = terms.led
        return Command(
            torque=torque,
            dynamics=dynamics,
            dampers=added.dampers,
            impedance_force=-resistance,
            decoupling_force=force,
            input_force=error.force,
            feed_forward=None if led is None else led.feed_forward,
        )

    def _with_torque_fade(self, command: Command, now: float) -> Command:
        """Return a command with what is left of a change that fades as a torque."""
        if not self._torque_fade.active(now):
            return command
        fading = self._torque_fade.added_to(np.zeros_like(command.torque), now)
        paid = fading if command.paid is None else command.paid + fading
        return replace(command, torque=command.torque + fading, paid=paid)

    def _reduced_command(
        self,
        mode: Mode,
        view: TeamEvaluator,
        seen: Evaluation,
        terms: TickTerms,
        pull: Array | None,
        damping: float,
    ) -> tuple[Command, Array]:
        """Return the command near a singularity: the natural law and a share of all beyond it.

        J' F needs no inverse of J; what does is scaled by the share, which is 0 where J has none.
        """
        now = terms.now
        command = self._reduced(mode, terms, pull, damping)
        if self.previous is not None:
            was = self._terms_before(view, seen, terms) if terms.share > 0.0 else terms
            before = self._with_torque_fade(self._reduced(self.previous, was, pull, damping), now)
            difference = before.torque - command.torque
            self._torque_fade.begin(now, difference, self._fading(mode))
            self.previous = None
        command = self._with_torque_fade(command, now)
        dynamics, v = terms.dynamics, terms.v
        still = np.zeros_like(v)
        left = command.torque - dynamics.torque(v, still)
        acceleration = dynamics.acceleration_under(left) + dynamics.acceleration_of(v, still)
        return command, acceleration

    def _reduced(
        self, mode: Mode, terms: TickTerms, pull: Array | None, damping: float
    ) -> Command:
        """Return what a mode asks for near a singularity, without what fades as a torque."""
        dynamics, error, added, tank = terms.dynamics, terms.error, terms.added, self._gate.tank
        share, v, g = terms.share, terms.v, terms.dynamics.g
        still = np.zeros_like(v)
        if mode.stopped:
            rate = share * self._stop.damping(terms.now) + damping
            torque = dynamics.torque(v, -rate * v)
            if share > 0.0 and self._fade.active(terms.now):
                fading = self._fade.added_to(still, terms.now)
                moved = dynamics.joint_acceleration(still, fading)
                torque = torque + share * (dynamics.torque(still, moved) - g)
            return self._with_pull(undivided(torque, dynamics), pull)
        resistance = added.resistance(tank.nu, share * tank.damping)
        force = np.zeros_like(resistance)
        feed_forward = None
        if share > 0.0:
            acceleration = self._fade.added_to(self._wanted(mode, v, terms), terms.now)
            beyond = beyond_natural(dynamics, error, acceleration, added.drift + resistance)
            force = share * beyond
            if terms.moving:
                feed_forward = share * terms.reference_motion().feed_forward
        damped = dynamics.torque(still, -damping * v) - g
        torque = g + damped + dynamics.torque_of(force + error.force - resistance)
        if feed_forward is not None:
            torque = torque + feed_forward
        command = Command(
            torque=torque,
            dynamics=dynamics,
            dampers=added.dampers,
            impedance_force=-resistance,
            decoupling_force=force,
            input_force=error.force,
            feed_forward=feed_forward,
            damped=damped,
        )
        return self._with_pull(command, pull)

    def _with_pull(self, command: Command, pull: Array | None) -> Command:
        """Return a command with the pull out of a singularity.

        The tank pays for the way back to a regular state; an escape is a motion that the team
        makes by itself, booked like that of references.
        """
        if pull is None:
            return command
        dynamics, still = command.dynamics, np.zeros_like(pull)
        if self.escaping:
            led = dynamics.torque(still, pull) - dynamics.g
            asked = led if command.feed_forward is None else command.feed_forward + led
            return replace(command, torque=command.torque + led, feed_forward=asked)
        torque = dynamics.torque(still, self._gate.tank.sigma * pull) - dynamics.g
        return replace(command, torque=command.torque + torque, paid=torque)
