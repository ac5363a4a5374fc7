# SPDX-License-Identifier: Apache-2.0
"""The gated law's bookkeeping: from what was commanded and where the team went to the gates."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.energy.account import EnergyAccount
from noninteract_ros.control.energy.command_log import Command, CommandLog
from noninteract_ros.control.energy.tank import (
    EnergyTank,
    Interval,
    TankSettings,
    full_tank,
    observed,
    refill,
    revalue,
    step,
)
from noninteract_ros.control.fast.compiled_layout import CompiledLayout
from noninteract_ros.control.law.decoupling import TaskDynamics, TaskError
from noninteract_ros.control.law.gated_law import Decoupling, beyond_natural
from noninteract_ros.control.law.impedance import Impedance
from noninteract_ros.subtasks.reference import Reference
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team

GATED = "energy_gated"
SIGMAS = {"natural": 0.0, "noninteracting": 1.0, "paper": 1.0}  # of laws that have no gates


@dataclass(frozen=True, slots=True)
class TickTerms:
    """One tick as the account sees it.

    Attributes:
        now: Time [s].
        q: Configuration, shape (nq,).
        x: Subtask values, stacked.
        references: Desired motion of each subtask.
        error: Tracking state of the subtasks.
        dynamics: Task dynamics.
        impedance: Gains in force.
        added: What complete decoupling adds to the natural law.
    """

    now: float
    q: Array
    x: Array
    references: Sequence[Reference]
    error: TaskError
    dynamics: TaskDynamics
    impedance: Impedance
    added: Decoupling

    def kinetic(self, e_rate: Array) -> float:
        """e_rate' Lambda e_rate / 2 [J]."""
        return float(0.5 * e_rate @ self.dynamics.multiply_by_inertia(e_rate))

    def potential(self) -> float:
        """U(e) [J]."""
        return float(self.impedance.potential(self.error.e).sum())


class EnergyGate:
    """Keeps the account of one team and its gates.

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
        self.restart()

    @property
    def settings(self) -> TankSettings:
        """Capacity, levels and rates; may be changed at any time."""
        return self._settings

    @settings.setter
    def settings(self, settings: TankSettings) -> None:
        self._settings = settings
        others = max(1, len(self._stack.subtasks) - 1)
        credit = others * settings.reference_credit  # kappa = p - 1 covers any free motion.
        self._scaled = replace(settings, reference_credit=credit)
        self._withheld = replace(self._scaled, refill_fraction=0.0)

    @property
    def account(self) -> EnergyAccount:
        """The account as of the last tick that was booked."""
        return self._account

    @property
    def tank(self) -> EnergyTank[float]:
        """Energies and gates as of the last tick that was booked."""
        return self._account.tank

    def restart(self) -> None:
        """A fresh account from the next tick on."""
        tank = full_tank(self._settings, 0.0)
        self._account = EnergyAccount(tank, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, self._number, False)
        self.pause()

    def pause(self) -> None:
        """Leaves out what happens until the next tick; energies and gates stay as they are."""
        self._last: TickTerms | None = None
        self._lifted = 0.0
        self._commands.forget()

    def refill(self) -> None:
        """Fills the tank anew, on an operator's request."""
        self._account = replace(self._account, tank=refill(self.tank, self._settings))

    def book(self, moment: TickTerms, law: str, applied: Array | None = None) -> None:
        """Accounts for the motion since the last tick and sets the gates of this one.

        Args:
            moment: This tick.
            law: Law in force; only `energy_gated` has gates.
            applied: Torque that the team reports to have had since the last tick, shape (n,);
                None, if it was the last command.
        """
        lifted = self._team.mechanical_energy(moment.q, self._still)
        kinetic = moment.kinetic(moment.error.e_rate)
        if not math.isfinite(kinetic + moment.potential()):
            self.pause()
            return
        booked = False
        command = self._commands.applied(applied)
        if self._last is not None and command is not None:
            booked = self._add(self._last, command, moment, law, kinetic, lifted)
        if not booked:
            self._begin(moment, law, kinetic)
        damping = float(moment.impedance.damping @ moment.error.e_rate**2)
        self._account = replace(
            self._account,
            kinetic=kinetic,
            dissipated=self.tank.grip * damping,
            demand=moment.added.power,
            gated=law == GATED,
        )
        self._last, self._lifted = moment, lifted

    def _add(
        self,
        last: TickTerms,
        command: Command,
        moment: TickTerms,
        law: str,
        kinetic: float,
        lifted: float,
    ) -> bool:
        """Books one interval; False, with nothing changed, where its numbers are none."""
        account = self._account
        interval = self._interval(last, command, moment, kinetic, lifted)
        works = interval.impedance_work + interval.decoupling_work + interval.input_work
        received = kinetic - account.kinetic - interval.kinetic_jump - works
        refilling = self._scaled if command.whole else self._withheld
        tank = step(account.tank, interval, refilling)
        tank = revalue(tank, moment.potential())  # Other gains than at the last tick are paid.
        tank = tank if law == GATED else observed(tank, SIGMAS[law])
        stored = abs(account.whole) + abs(account.received) + abs(tank.brought) + tank.lost
        moved = abs(received) + abs(interval.kinetic_jump) + abs(interval.input_work) + kinetic
        added = stored + moved + abs(interval.impedance_work) + abs(interval.decoupling_work)
        if not math.isfinite(added):
            return False
        self._account = replace(
            account,
            tank=tank,
            received=account.received + received,
            turnover=account.turnover + added,
        )
        return True

    def remember(
        self, moment: TickTerms, torque: Array, acceleration: Array, whole: bool = True
    ) -> None:
        """Notes the torque of this tick, which a later one will account for.

        What the limits of joints change of it is booked as a push from outside.

        Args:
            moment: This tick, with the gains that were in force.
            torque: Torque as sent, shape (n,) [N or N m].
            acceleration: Task acceleration that was asked for, shape (n,).
            whole: Whether all that was asked for was sent.
        """
        grip, added = self.tank.grip, moment.added
        resistance = grip * added.feedback
        if acceleration is added.acceleration and grip == 1.0:
            force = added.force
        else:
            wanted = added.drift + resistance
            force = beyond_natural(moment.dynamics, moment.error, acceleration, wanted)
        pushed = moment.error.force
        self._commands.note(Command(torque, moment.dynamics, -resistance, force, pushed, whole))

    def remember_damping(self, moment: TickTerms, torque: Array) -> None:
        """Notes a torque that damps, beyond gravity, instead of following the law."""
        force = moment.dynamics.force_of(torque - moment.dynamics.g)
        none = np.zeros_like(force)
        self._commands.note(Command(torque, moment.dynamics, force, none, none))

    def _begin(self, moment: TickTerms, law: str, kinetic: float) -> None:
        """New sums; what tank and reserve hold goes on."""
        old, potential = self.tank, moment.potential()
        self._number += 1
        tank = replace(
            full_tank(self._settings, potential),
            level=old.level,
            reserve=old.reserve,
            sigma=old.sigma,
            grip=old.grip,
            owed=old.owed,
        )
        tank = tank if law == GATED else observed(tank, SIGMAS[law])
        start = kinetic + tank.grip * potential + tank.reserve + tank.level
        self._account = EnergyAccount(
            tank, kinetic, 0.0, 0.0, 0.0, start, start, self._number, law == GATED
        )

    def _interval(
        self, last: TickTerms, command: Command, moment: TickTerms, kinetic: float, lifted: float
    ) -> Interval[float]:
        """What was measured since the last tick, with the gains that were in force then."""
        duration = moment.now - last.now
        foretold, foretold_rate, travelled = self._foretold(last, duration)
        turned = self._team.difference(last.q, moment.q)
        # A torque held over the tick does the work of a task force held with J of its own tick.
        moved = command.dynamics.velocity(turned) - travelled
        held = float(command.dynamics.g @ turned) - (lifted - self._lifted)
        arrived = last.impedance.potential(self._layout.difference(moment.x, foretold))
        e_rate = moment.error.e_rate
        rate_arrived = e_rate + moment.error.reference_velocity - foretold_rate
        jump = 0.0 if (rate_arrived == e_rate).all() else kinetic - moment.kinetic(rate_arrived)
        potential = last.impedance.potential(moment.error.e)
        own = 0.5 * e_rate * moment.dynamics.multiply_by_inertias(e_rate)
        return Interval(
            duration,
            float(command.impedance_force @ moved) + held,
            float(command.decoupling_force @ moved),
            float(command.input_force @ moved),
            float(arrived.sum()),
            float(potential.sum()),
            jump,
            float((own + potential).sum()),
            moment.added.power,
        )

    def _foretold(self, last: TickTerms, duration: float) -> tuple[Array, Array, Array]:
        """Where references were bound: value, rate, and the way there, shape (n,)."""
        then = [
            reference.extrapolate(duration, subtask.layout)
            for reference, subtask in zip(last.references, self._stack.subtasks, strict=True)
        ]
        rate = np.concatenate([item.velocity for item in then])
        way = 0.5 * duration * (last.error.reference_velocity + rate)
        return np.concatenate([item.position for item in then]), rate, way
