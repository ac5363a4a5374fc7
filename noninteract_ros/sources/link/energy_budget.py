# SPDX-License-Identifier: Apache-2.0
"""Energy budget of one end of a link, and the packets that carry energy counts.

Each end counts the energy that it has absorbed in total. The count never falls and is part of
every packet. The other end may spend the growth of the largest count received. So a lost packet
delays energy, and a late or repeated one adds none.
"""

from typing import NamedTuple

from noninteract_ros.arrays import Array


class Packet(NamedTuple):
    """Packet from one end to the other.

    Attributes:
        number: Sequence number, increasing.
        signals: Signals of the sender: position and velocity, or a force.
        energy: Total energy that the sender has absorbed for the other end [J].
        level: Energy that the sender may still spend [J].
    """

    number: int
    signals: tuple[Array, ...]
    energy: float
    level: float


class Budget:
    """Energy that an end may spend: the energy reported by the other end, less the energy spent.

    Args:
        reserve: Initial level [J].
        capacity: Highest level; energy above it is discarded [J].

    Attributes:
        level: Energy that may be spent now [J]; negative where overdrawn.
    """

    def __init__(self, reserve: float, capacity: float) -> None:
        self._capacity = max(reserve, capacity)
        self.level = reserve
        self._reported = 0.0

    def receive(self, energy: float) -> None:
        """Update with a received energy count of the other end [J]."""
        if energy > self._reported:
            self.level = min(self.level + energy - self._reported, self._capacity)
            self._reported = energy

    def save(self, energy: float, level: float) -> float:
        """Save energy [J] until the level reaches `level`; return the remainder [J]."""
        saved = min(energy, max(level - self.level, 0.0))
        self.level += saved
        return energy - saved


class PacketOrder:
    """Filter that rejects packets overtaken by newer ones."""

    def __init__(self) -> None:
        self._number = -1

    def accept(self, packet: Packet) -> bool:
        """Return True, and store the number, if a packet is newer than all before it."""
        if packet.number <= self._number:
            return False
        self._number = packet.number
        return True
