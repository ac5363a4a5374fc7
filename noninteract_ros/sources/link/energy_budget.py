# SPDX-License-Identifier: Apache-2.0
"""The energy that one end of a connection may spend, and the packets that bring it.

Each end counts the energy that it has taken up in all, which never falls, and sends the count with
every packet. The other end may spend by how much the greatest count that has arrived has grown: a
lost packet makes energy come later, a late or repeated one brings none.
"""

from typing import NamedTuple

from noninteract_ros.arrays import Array


class Packet(NamedTuple):
    """What one end tells the other.

    Attributes:
        number: Number of the packet, growing.
        signals: What it has measured: position and velocity, or a force.
        energy: Energy that it has taken up for the other end in all [J].
        level: Energy that it may still spend itself [J].
    """

    number: int
    signals: tuple[Array, ...]
    energy: float
    level: float


class Budget:
    """What an end may spend: what the other end has announced, less what was spent.

    Args:
        reserve: Level at the start [J].
        capacity: Highest level; what comes beyond it is forgone [J].

    Attributes:
        level: What may be spent now [J]; below zero it is overdrawn.
    """

    def __init__(self, reserve: float, capacity: float) -> None:
        self._capacity = max(reserve, capacity)
        self.level = reserve
        self._announced = 0.0

    def announce(self, energy: float) -> None:
        """Takes note of a count of the other end [J]."""
        if energy > self._announced:
            self.level = min(self.level + energy - self._announced, self._capacity)
            self._announced = energy

    def keep(self, energy: float, level: float) -> float:
        """Saves energy [J] until the level is as high as `level`; returns what is left of it."""
        saved = min(energy, max(level - self.level, 0.0))
        self.level += saved
        return energy - saved


class Newest:
    """Tells packets that are newer than all before them from those that were overtaken."""

    def __init__(self) -> None:
        self._number = -1

    def is_newer(self, packet: Packet) -> bool:
        """Whether a packet is the newest so far; it then counts as arrived."""
        if packet.number <= self._number:
            return False
        self._number = packet.number
        return True
