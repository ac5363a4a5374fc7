# SPDX-License-Identifier: Apache-2.0
"""References of a source announced ahead of time, as a controller in lockstep needs them."""

import math
from collections.abc import Iterator
from typing import Protocol

from noninteract_ros.arrays import Array
from noninteract_ros.clock import seconds, stamp, tick_stamp
from noninteract_ros.subtasks.reference import Reference

HORIZON = 0.5
"""Time ahead [s] for which a source without further references releases the controller."""


class Sampler(Protocol):
    """A source of references with a known schedule."""

    def sample(self, t: float, feedback: Array | None = None) -> Reference | None:
        """Return the reference at an update instant [s], or None."""

    def next_sample(self, t: float) -> float:
        """Return the first update instant after `t` with a reference [s]."""


class Announcer:
    """References of a sampler in order of time, each announced once.

    Args:
        sampler: Source of the references.
        rate: Ticks per second of the team [Hz].
    """

    def __init__(self, sampler: Sampler, rate: float) -> None:
        self._sampler, self._rate = sampler, rate
        self._sampled = self._announced = -math.inf

    def reset(self, now: float) -> None:
        """Start at a time [s]; skip earlier instants."""
        self._sampled = now - 0.5 / self._rate
        self._announced = -math.inf

    def announce(
        self, until: float, feedback: Array | None = None
    ) -> Iterator[tuple[int, Reference | None]]:
        """Yield stamps [ns] with references up to a time.

        None instead of a reference means "nothing new up to and including this stamp".

        Args:
            until: Last time to announce [s].
            feedback: Force on the operator's device, shape (p,) [N].
        """
        limit = until + 1e-9
        while (following := self._sampler.next_sample(self._sampled)) <= limit:
            yield stamp(following), self._sampler.sample(following, feedback)
            self._sampled = self._announced = following
        last_silent = math.ceil(min(following, until + HORIZON) * self._rate - 1e-3) - 1
        marker = tick_stamp(last_silent, self._rate)
        silence = seconds(marker) - self._announced
        if silence > 1.5 / self._rate or (silence > 0.0 and self._announced < limit - 2e-9):
            self._announced = seconds(marker)
            yield marker, None
