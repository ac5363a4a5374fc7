# SPDX-License-Identifier: Apache-2.0
"""One direction of a link: packets are delayed, reordered or lost."""

import heapq
from typing import Generic, TypeVar

import numpy as np

from noninteract_ros.sources.link.settings import LinkSettings

Payload = TypeVar("Payload")
TOLERANCE = 1e-9  # Arrivals up to this much later than the requested time count as arrived [s].


class Channel(Generic[Payload]):
    """Packets in transit; the delay and loss of the n-th one depend on the seed and n alone.

    Args:
        settings: Delay, its spread, losses, and whether packets may overtake each other.
        direction: Number that distinguishes the two directions of a link.

    Attributes:
        sent: Count of packets sent.
        lost: Count of packets that never arrive.
    """

    def __init__(self, settings: LinkSettings, direction: int) -> None:
        self._settings, self._direction = settings, direction
        self.reset()

    def reset(self) -> None:
        """Discard all packets and restart the random sequence."""
        self._random = np.random.default_rng([self._settings.seed, self._direction])
        self._under_way: list[tuple[float, int, Payload]] = []
        self._last_arrival = -np.inf
        self.sent = self.lost = 0

    def send(self, now: float, payload: Payload) -> None:
        """Send a packet at a time [s]."""
        settings = self._settings
        spread, uniform = self._random.uniform(-1.0, 1.0), self._random.random()
        self.sent += 1
        if uniform < settings.loss:
            self.lost += 1
            return
        arrival = now + settings.delay * (1.0 + settings.jitter * spread)
        if not settings.reordering:
            arrival = self._last_arrival = max(arrival, self._last_arrival)
        heapq.heappush(self._under_way, (arrival, self.sent, payload))

    def receive(self, now: float) -> list[Payload]:
        """Return the packets that have arrived by a time [s] since the last call, in order."""
        arrived = []
        while self._under_way and self._under_way[0][0] <= now + TOLERANCE:
            arrived.append(heapq.heappop(self._under_way)[2])
        return arrived
