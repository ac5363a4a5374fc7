# SPDX-License-Identifier: Apache-2.0
"""Which of the torques that were commanded was applied."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.decoupling import TaskDynamics

REMEMBERED = 50  # commands among which the torque that a team reports is looked for
MATCH = 0.02  # relative to the largest torque: drives that report what they measure


@dataclass(frozen=True, slots=True)
class Command:
    """A torque that was commanded and what it is made of, beyond the feed-forward.

    Attributes:
        torque: Control torque, shape (n,) [N or N m].
        dynamics: Task dynamics of its tick; its J turns the forces into torques.
        impedance_force: -nu (D e_rate + h(e)), shape (n,) [N].
        decoupling_force: All that is neither impedance nor an input, shape (n,) [N].
        input_force: Force inputs of the sources, shape (n,) [N].
        whole: Whether all of it was sent; what limits cut off did not damp either.
    """

    torque: Array
    dynamics: TaskDynamics
    impedance_force: Array
    decoupling_force: Array
    input_force: Array
    whole: bool = True


class CommandLog:
    """The last commands."""

    def __init__(self) -> None:
        self._commands: deque[Command] = deque(maxlen=REMEMBERED)

    def forget(self) -> None:
        """Nothing has been commanded."""
        self._commands.clear()

    def note(self, command: Command) -> None:
        """Takes the command of a tick."""
        self._commands.append(command)

    def applied(self, torque: Array | None) -> Command | None:
        """The command nearest to the torque that a team reports; None before the first one.

        Without a report it is the last one. Where no command is near this torque, brakes or
        drives have given it: all of it beyond gravity then counts as the impedance's.

        Args:
            torque: What the team reports, shape (n,) [N or N m], or None.
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
            return nearest
        dynamics = newest.dynamics
        none = np.zeros_like(torque)
        force = dynamics.force_of(torque - dynamics.g)
        return Command(torque, dynamics, force, none, none, False)
