# SPDX-License-Identifier: Apache-2.0
"""Ends of a link that exchange wave variables instead of force and velocity.

With a diagonal wave impedance B, the waves of a force F and a velocity v are

    u = (B v + F) / sqrt(2 B),  w = (B v - F) / sqrt(2 B),  F' v = (u' u - w' w) / 2,

so a constant delay of u and w stores energy and generates none. A varying delay and lost or held
packets may generate some. Hence both ends still observe their ports and deliver no more than the
other end has reported (`time_domain_passivity.py`): the waves determine the wanted force or
velocity, the energy account limits it.
"""

from functools import cached_property

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.sources.link.settings import LinkSettings
from noninteract_ros.sources.link.time_domain_passivity import ObservedDevice, ObservedTeam
from noninteract_ros.subtasks.reference import Reference

CATCH_UP = 2.0  # Decay rate of a position difference, which waves alone would keep [1/s].


class _Waves:
    """Wave impedance B of a link and the root of 2 B, shape (p,) each."""

    _settings: LinkSettings
    _metric: Array

    @cached_property
    def _impedance(self) -> Array:
        return self._settings.impedance * self._metric

    @cached_property
    def _root(self) -> Array:
        return np.asarray(np.sqrt(2.0 * self._impedance))


class WaveDevice(_Waves, ObservedDevice):
    """Device's end: receives w, applies f = sqrt(2 B) w - B v, sends u."""

    def _wanted(self, velocity: Array) -> Array:
        return self._root * self._received - self._impedance * velocity

    def _signal(self, force: Array, displacement: Array, motion: Reference) -> Array:
        """Return the wave of the applied force and the mean velocity of the tick."""
        return (self._impedance * (displacement / self._period) - force) / self._root


class WaveTeam(_Waves, ObservedTeam):
    """Team's end: receives u, moves with v = (sqrt(2 B) u - F) / B, sends w.

    The velocity is smoothed with the link's bandwidth, since the force follows it at once through
    the damping. Differences from the received position decay.
    """

    def resume(self, start: Reference) -> None:
        """Start at the device's present motion, without a wave."""
        self._now, self._received = start, (start.position, np.zeros_like(start.velocity))

    def _wanted(self, feedback: Array) -> Array:
        position, wave = self._received
        error = self._layout.difference(position, self._now.position)
        goal = (self._root * wave + feedback) / self._impedance + CATCH_UP * error
        share = self._period * self._settings.bandwidth
        return self._now.velocity + share * (goal - self._now.velocity)

    def _signal(self, feedback: Array) -> Array:
        return (self._impedance * self._now.velocity + feedback) / self._root
