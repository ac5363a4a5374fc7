# SPDX-License-Identifier: Apache-2.0
"""Torques that were sent, with the parts that they are made of."""

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.decoupling import TaskDynamics

REMEMBERED = 50  # commands among which the torque that a team reports is looked for
MATCH = 0.02  # relative to the largest torque: drives that report what they measure


@dataclass(frozen=True, slots=True)
class Command:
    """A torque and what it is made of beyond gravity, as it was sent.

    tau = g + feed_forward + J' (impedance + decoupling + input) + paid + damped + other

    Attributes:
        torque: Control torque, shape (n,) [N or N m].
        dynamics: Task dynamics of its tick; its J turns the forces into torques.
        dampers: D e_rate, shape (n,) [N], whatever share of it is in force.
        impedance_force: -(nu h(e) + damping D e_rate), shape (n,) [N].
        decoupling_force: sigma S' Delta, shape (n,) [N].
        input_force: Force inputs of the sources, shape (n,) [N].
        feed_forward: Y = M a_r + C v_r as far as it is in force, shape (n,) [N or N m]; None for
            zero.
        paid: Torque that the tank pays like the decoupling, shape (n,); None for zero.
        damped: Torque of joint dampers and stops, shape (n,); None for zero.
        other: All the rest, shape (n,): joint limits, and what was cut; None for zero.
        repulsion: The part -dV/dq of it, shape (n,); None for zero.
        whole: False where the torque is none that was sent, so that nothing refills the tank.
    """

    torque: Array
    dynamics: TaskDynamics
    dampers: Array
    impedance_force: Array
    decoupling_force: Array
    input_force: Array
    feed_forward: Array | None = None
    paid: Array | None = None
    damped: Array | None = None
    other: Array | None = None
    repulsion: Array | None = None
    whole: bool = True

    def at_reserve(self) -> Array | None:
        """Torque on the joints whose work is the reserve's, shape (n,); None for zero."""
        if self.damped is None or self.other is None:
            return self.other if self.damped is None else self.damped
        return self.damped + self.other


def with_paid(command: Command, paid: Array) -> Command:
    """Return a command with a torque, shape (n,), that the tank pays like the decoupling."""
    if not paid.any():
        return command
    whole = paid if command.paid is None else command.paid + paid
    return replace(command, torque=command.torque + paid, paid=whole)


def undivided(torque: Array, dynamics: TaskDynamics, whole: bool = True) -> Command:
    """Return a torque all of which, beyond gravity, is booked as one force on the joints."""
    none = np.zeros_like(torque)
    return Command(
        torque=torque,
        dynamics=dynamics,
        dampers=none,
        impedance_force=none,
        decoupling_force=none,
        input_force=none,
        damped=torque - dynamics.g,
        whole=whole,
    )


class CommandLog:
    """The last commands."""

    def __init__(self) -> None:
        self._commands: deque[Command] = deque(maxlen=REMEMBERED)

    def reset(self) -> None:
        """Drop all commands."""
        self._commands.clear()

    def record(self, command: Command) -> None:
        """Store the command of a tick."""
        self._commands.append(command)

    def applied(self, torque: Array | None) -> Command | None:
        """Return the command nearest to the torque that a team reports; None before the first.

        Without a report it is the last one. A torque that is reported near a command differs from
        it by what the drives made of it, which is booked with the rest. Where no command is near,
        brakes or drives have given the torque: all of it beyond gravity is booked as one force.

        Args:
            torque: Reported torque, shape (n,) [N or N m], or None.
        """
        if not self._commands:
            return None
        newest = self._commands[-1]
        if torque is None:
            self._commands.clear()
            return newest
        nearest, distance = newest, np.inf
        for command in reversed(self._commands):
            away = float(np.abs(command.torque - torque).max())
            if away < distance:
                nearest, distance = command, away
            if away == 0.0:
                break
        if distance <= MATCH * (1.0 + np.abs(nearest.torque).max()):
            while self._commands[0] is not nearest:  # Their time is over.
                self._commands.popleft()
            if distance == 0.0:
                return nearest
            added = torque - nearest.torque
            other = added if nearest.other is None else nearest.other + added
            return replace(nearest, torque=torque, other=other)
        return undivided(torque, newest.dynamics, whole=False)
