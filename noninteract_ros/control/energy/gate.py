# SPDX-License-Identifier: Apache-2.0
"""The account of a team: from torques that were sent and motions that followed to the gates.

Where a torque tau is held over a tick, the robots' mechanical energy changes by tau' dq plus the
work of the environment, whatever happens in between. All of tau' dq is booked here: what the tank
pays, what references and inputs bring, what lifts weights, and all the rest at the reserve's cost.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.energy.account import EnergyAccount
from noninteract_ros.control.energy.command_log import Command, CommandLog
from noninteract_ros.control.energy.tank import (
    EnergyTank,
    Interval,
    TankLevels,
    TankSettings,
    carry,
    deepen,
    full_tank,
    levels,
    loosen,
    refill,
    revalue,
    step,
    whole,
)
from noninteract_ros.control.fast.compiled_layout import CompiledLayout
from noninteract_ros.control.law.decoupling import TaskDynamics, TaskError
from noninteract_ros.control.law.gated_law import Decoupling
from noninteract_ros.control.law.impedance import Impedance
from noninteract_ros.subtasks.reference import Reference
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team

GATED = "energy_gated"
SMOOTH = 1e-12  # relative jump of a reference velocity that counts as rounding
SIGMAS = {"natural": 0.0, "noninteracting": 1.0, "paper": 1.0}  # of laws that have no gates


@dataclass(frozen=True, slots=True)
class ReferenceMotion:
    """Motion of the joints that follows all references, v_r = S dx_d/dt.

    Attributes:
        velocity: v_r, shape (n,).
        feed_forward: Y = M a_r + C v_r with a_r = dv_r/dt, shape (n,) [N or N m].
    """

    velocity: Array
    feed_forward: Array


@dataclass(frozen=True)
class TickTerms:
    """One tick as law and account use it.

    Attributes:
        now: Time [s].
        q: Configuration, shape (nq,).
        v: Velocity, shape (n,).
        x: Subtask values, stacked.
        references: Desired motion of each subtask.
        error: Tracking state of the subtasks.
        dynamics: Task dynamics.
        impedance: Gains in force.
        added: What complete decoupling adds to the natural law.
        share: Share of the decoupling that the state allows, 0 to 1; see `SingularityGuard`.
        margins: V, the potential of the joint limits' margins [J].
    """

    now: float
    q: Array
    v: Array
    x: Array
    references: Sequence[Reference]
    error: TaskError
    dynamics: TaskDynamics
    impedance: Impedance
    added: Decoupling
    share: float
    margins: float

    @cached_property
    def moving(self) -> bool:
        """True where a reference moves."""
        error = self.error
        return bool(error.reference_velocity.any() or error.reference_acceleration.any())

    @cached_property
    def led(self) -> ReferenceMotion | None:
        """Motion of the references; None at rest, and where the Jacobian is near singular."""
        return self.reference_motion() if self.share == 1.0 and self.moving else None

    def reference_motion(self) -> ReferenceMotion:
        """Return the motion of the references, whatever the Jacobian."""
        dynamics, error = self.dynamics, self.error
        velocity = dynamics.joint_acceleration(np.zeros_like(self.v), error.reference_velocity)
        acceleration = dynamics.joint_acceleration(velocity, error.reference_acceleration)
        feed_forward = dynamics.torque(velocity, acceleration) - dynamics.g
        return ReferenceMotion(velocity, feed_forward)

    def kinetic(self, e_rate: Array) -> float:
        """Return e_rate' Lambda e_rate / 2 [J]."""
        return float(0.5 * e_rate @ self.dynamics.multiply_by_inertia(e_rate))

    def robots_kinetic(self) -> float:
        """Return v' M v / 2 [J]."""
        dynamics = self.dynamics
        return float(0.5 * self.v @ (dynamics.torque(np.zeros_like(self.v), self.v) - dynamics.g))

    def port_kinetic(self) -> float:
        """Return T of the port, of the motion beyond the references where they are followed."""
        return self.kinetic(self.error.e_rate) if self.share == 1.0 else self.robots_kinetic()

    def potential(self) -> float:
        """Return U(e) [J]."""
        return float(self.impedance.potential(self.error.e).sum())


class EnergyGate:
    """Account of one team and its gates, kept whatever the law, for the life of the team.

    Args:
        team: The robots.
        stack: Their subtasks.
        settings: Capacity, levels and rates of the account.
    """

    def __init__(self, team: Team, stack: SubtaskStack, settings: TankSettings) -> None:
        self._team, self._stack = team, stack
        self._layout = CompiledLayout(stack.layout)
        self._still = np.zeros(team.n)
        self._number = 0
        self._commands = CommandLog()
        self.settings = settings
        self.reset()

    @property
    def settings(self) -> TankSettings:
        """Capacity, levels and rates; may be changed at any time."""
        return self._settings

    @settings.setter
    def settings(self, settings: TankSettings) -> None:
        self._settings = settings
        others = max(1, len(self._stack.subtasks) - 1)
        credit = others * settings.reference_credit  # kappa = p - 1 covers any free motion.
        self._levels = levels(settings, credit)
        self._withheld = levels(settings, credit, refills=False)

    @property
    def levels(self) -> TankLevels:
        """The settings as numbers."""
        return self._levels

    @property
    def account(self) -> EnergyAccount:
        """The account as of the last tick that was booked."""
        return self._account

    @property
    def tank(self) -> EnergyTank:
        """Energies and gates as of the last tick that was booked."""
        return self._account.tank

    def reset(self) -> None:
        """Begin the account of another life, with what the settings grant."""
        tank = full_tank(self._levels, 0.0)
        self._account = EnergyAccount(
            tank=tank,
            kinetic=0.0,
            dissipated=0.0,
            demand=0.0,
            received=0.0,
            start=0.0,
            turnover=0.0,
            number=self._number,
            fixed=None,
        )
        self.interrupt()

    def interrupt(self) -> None:
        """Leave out the time until the next tick, whose state does not follow from the last."""
        self._last: TickTerms | None = None
        self._lifted = 0.0
        self._commands.reset()

    def refill(self) -> None:
        """Fill tank and reserve, on an operator's request."""
        self._account = replace(self._account, tank=refill(self.tank, self._levels))

    def deepen(self, margins: float) -> None:
        """Pay for margins of joint limits that reach further out; V is then `margins` [J]."""
        self._account = replace(self._account, tank=deepen(self.tank, margins))

    def loosen(self, nu: float) -> None:
        """Leave a smaller share of the springs in force than the account would."""
        self._account = replace(self._account, tank=loosen(self.tank, nu))

    def book(self, terms: TickTerms, law: str, applied: Array | None = None) -> None:
        """Account for the motion since the last tick and set the gates of this one.

        Args:
            terms: This tick.
            law: Law in force; only `energy_gated` has gates.
            applied: Torque that the team reports to have had since the last tick, shape (n,);
                None, if it was the last command.
        """
        lifted = self._team.mechanical_energy(terms.q, self._still)
        kinetic = terms.port_kinetic()
        if not math.isfinite(kinetic + terms.potential()):
            self.interrupt()
            return
        booked = False
        command = self._commands.applied(applied)
        if self._last is not None and command is not None:
            booked = self._add(self._last, command, terms, law, kinetic, lifted)
        if not booked:
            self._begin(terms, law, kinetic)
        dampers = float(terms.impedance.damping @ terms.error.e_rate**2)
        self._account = replace(
            self._account,
            kinetic=kinetic,
            dissipated=self.tank.damping * dampers,
            demand=terms.share * terms.added.power,
            fixed=SIGMAS.get(law),
        )
        self._last, self._lifted = terms, lifted

    def record(self, command: Command) -> None:
        """Store what is sent at this tick; a later tick accounts for it."""
        self._commands.record(command)

    def _add(
        self,
        last: TickTerms,
        command: Command,
        terms: TickTerms,
        law: str,
        kinetic: float,
        lifted: float,
    ) -> bool:
        """Book one interval; return False, with nothing changed, where its numbers are none."""
        account = self._account
        interval, works, jump = self._interval(last, command, terms, kinetic, lifted)
        received = kinetic - account.kinetic - jump - works
        tank = step(account.tank, interval, self._levels if command.whole else self._withheld)
        tank = revalue(tank, terms.potential())  # Other gains than at the last tick are paid.
        tank = tank if law == GATED else whole(tank, account.tank)
        stored = abs(account.whole) + abs(account.received) + abs(tank.brought) + tank.lost
        moved = abs(received) + abs(jump) + abs(interval.led) + kinetic
        added = stored + moved + abs(interval.other_work) + abs(interval.decoupling_work)
        if not math.isfinite(added):
            return False
        self._account = replace(
            account,
            tank=tank,
            received=account.received + received,
            turnover=account.turnover + added,
        )
        return True

    def _begin(self, terms: TickTerms, law: str, kinetic: float) -> None:
        """Begin new sums; what tank and reserve hold goes on."""
        self._number += 1
        tank = carry(self.tank, self._levels, terms.potential(), terms.margins)
        tank = tank if law == GATED else whole(tank, self.tank)
        start = kinetic + tank.nu * tank.potential + tank.margins + tank.reserve + tank.level
        self._account = EnergyAccount(
            tank=tank,
            kinetic=kinetic,
            dissipated=0.0,
            demand=0.0,
            received=0.0,
            start=start,
            turnover=start,
            number=self._number,
            fixed=SIGMAS.get(law),
        )

    def _interval(
        self, last: TickTerms, command: Command, terms: TickTerms, kinetic: float, lifted: float
    ) -> tuple[Interval, float, float]:
        """Measure the time since the last tick, with the gains that were in force then.

        Returns:
            What is booked, the work of all forces in it, and the jump of T that references made.
        """
        duration = terms.now - last.now
        predicted, predicted_rate, travelled = self._predicted(last, duration)
        dynamics = command.dynamics
        turned = self._team.difference(last.q, terms.q)
        # A torque held over the tick does the work of a task force held with J of its own tick.
        way = dynamics.velocity(turned)
        moved = way - travelled
        held = float(dynamics.g @ turned) - (lifted - self._lifted)
        decoupling, inputs = command.decoupling_force, command.input_force
        led = float(inputs @ moved)
        beyond = turned
        against = 0.0
        if last.share < 1.0:  # The port is that of the whole motion, v_r = 0.
            pulled = inputs + command.impedance_force + decoupling
            led += float(pulled @ travelled)
            if command.feed_forward is not None:
                led += float(command.feed_forward @ turned)
        elif last.led is not None:
            motion, late = self._led_to(terms, predicted_rate, last.error.reference_acceleration)
            followed = 0.5 * duration * (last.led.velocity + motion.velocity)
            beyond = turned - followed
            force = inputs + decoupling + command.impedance_force
            led += float(force @ (travelled - dynamics.velocity(followed)))
            led += float((0.5 * (last.dynamics.g + terms.dynamics.g) - dynamics.g) @ followed)
            mean = 0.5 * (last.led.feed_forward + motion.feed_forward)
            led -= float(mean @ beyond) + 0.5 * float(late @ moved)
            if command.repulsion is not None:  # V moves with the joints, references against it.
                against = float(command.repulsion @ followed)
                led -= against
            if command.feed_forward is not None:
                led += float(command.feed_forward @ beyond)
        elif command.feed_forward is not None:  # Sent before the references came to rest.
            led += float(command.feed_forward @ turned)
        paid = float(decoupling @ moved)
        if command.paid is not None:
            paid += float(command.paid @ beyond)
        other = float(command.impedance_force @ moved) + held + against
        if (rest := command.at_reserve()) is not None:
            other += float(rest @ beyond)
        arrived = last.impedance.potential(self._layout.difference(terms.x, predicted))
        jump = self._jump(last, terms, predicted_rate, kinetic)
        potential = last.impedance.potential(terms.error.e)
        e_rate = terms.error.e_rate
        own = 0.5 * e_rate * terms.dynamics.multiply_by_inertias(e_rate) if terms.share else 0.0
        interval = Interval(
            step=duration,
            decoupling_work=paid,
            other_work=other,
            damped=float(command.dampers @ moved),
            arrived=float(arrived.sum()),
            potential=float(potential.sum()),
            margins=terms.margins,
            led=jump + led,
            storage=float((own + potential).sum()),
            demand=terms.share * terms.added.power,
        )
        return interval, other + paid + led, jump

    @staticmethod
    def _led_to(
        terms: TickTerms, rate: Array, acceleration: Array
    ) -> tuple[ReferenceMotion, Array]:
        """Return where references were bound, in the joints at the state that was reached.

        Args:
            terms: This tick.
            rate: Predicted velocity of the references, shape (n,).
            acceleration: Their acceleration until now, shape (n,).

        Returns:
            The motion, and the force on the subtasks, shape (n,), that its feed-forward lacks.
        """
        error = terms.error
        change = acceleration - error.reference_acceleration
        jump = np.abs(rate - error.reference_velocity).max()
        if terms.led is not None and jump <= SMOOTH * (1.0 + np.abs(rate).max()):
            return terms.led, terms.dynamics.multiply_by_inertia(change)
        moved = replace(error, reference_velocity=rate, reference_acceleration=acceleration)
        return replace(terms, error=moved).reference_motion(), np.zeros_like(rate)

    def _jump(
        self, last: TickTerms, terms: TickTerms, predicted_rate: Array, kinetic: float
    ) -> float:
        """Return what references changed in T at this tick beyond their prediction [J]."""
        e_rate, share = terms.error.e_rate, last.share
        rate = e_rate + terms.error.reference_velocity - predicted_rate
        if share == terms.share == 1.0 and (rate == e_rate).all():
            return 0.0
        if not (terms.moving or last.moving):
            return 0.0  # T is one and the same.
        if share < 1.0 or terms.share == 0.0:
            return kinetic - terms.robots_kinetic()
        return kinetic - terms.kinetic(rate)

    def _predicted(self, last: TickTerms, duration: float) -> tuple[Array, Array, Array]:
        """Return where references were bound: value, rate, and the way there, shape (n,)."""
        then = [
            reference.extrapolate(duration, subtask.layout)
            for reference, subtask in zip(last.references, self._stack.subtasks, strict=True)
        ]
        rate = np.concatenate([item.velocity for item in then])
        way = 0.5 * duration * (last.error.reference_velocity + rate)
        return np.concatenate([item.position for item in then]), rate, way
