# SPDX-License-Identifier: Apache-2.0
"""What a source says ahead of time, so that a controller in lockstep knows when it may go on."""

import math
from collections.abc import Iterator
from typing import Protocol

from noninteract_ros.arrays import Array
from noninteract_ros.clock import seconds, stamp, tick_stamp
from noninteract_ros.subtasks.reference import Reference

FAR = 3600.0  # [s] how far a source that has nothing more to say lets the controller go


class Sampler(Protocol):
    """A source of references that knows when it will speak."""

    def sample(self, t: float, feedback: Array | None = None) -> Reference | None:
        """The reference at an update instant [s], or None."""

    def silent_until(self, t: float) -> float:
        """The first update instant later than `t` [s] for which there is a reference."""


class Announcer:
    """Speaks for every instant up to a time, once.

    Args:
        sampler: Where the references come from.
        rate: Ticks per second of the team [Hz].
    """

    def __init__(self, sampler: Sampler, rate: float) -> None:
        self._sampler, self._rate = sampler, rate
        self._said = self._heard = -math.inf

    def begin(self, now: float) -> None:
        """Starts at a time [s]; earlier instants are passed over."""
        self._said = now - 0.5 / self._rate
        self._heard = -math.inf

    def speak(
        self, until: float, feedback: Array | None = None
    ) -> Iterator[tuple[int, Reference | None]]:
        """Stamps [ns] with references, or with None for "nothing new up to and including it".

        Args:
            until: Time up to which to speak [s].
            feedback: Force on the operator's device, shape (p,) [N].
        """
        limit = until + 1e-9
        while (following := self._sampler.silent_until(self._said)) <= limit:
            yield stamp(following), self._sampler.sample(following, feedback)
            self._said = self._heard = following
        last_silent = math.ceil(min(following, until + FAR) * self._rate - 1e-3) - 1
        marker = tick_stamp(last_silent, self._rate)
        silence = seconds(marker) - self._heard
        if silence > 1.5 / self._rate or (silence > 0.0 and self._heard < limit - 2e-9):
            self._heard = seconds(marker)
            yield marker, None
