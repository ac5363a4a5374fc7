# SPDX-License-Identifier: Apache-2.0
"""Ends of a connection that exchange wave variables instead of force and velocity.

With an impedance B, diagonal, a force F and a velocity v are the waves

    u = (B v + F) / sqrt(2 B),  w = (B v - F) / sqrt(2 B),  F' v = (u' u - w' w) / 2,

so that delaying u on its way there and w on its way back stores energy and makes none. A delay
that varies and packets that are lost or held break that. Hence both ends still observe what passes
their ports and give away no more than was announced (`time_domain_passivity.py`): the waves say
what is wanted, the account what may be.
"""

from functools import cached_property

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.sources.link.settings import LinkSettings
from noninteract_ros.sources.link.time_domain_passivity import ObservedDevice, ObservedTeam
from noninteract_ros.subtasks.reference import Reference

CATCH_UP = 2.0  # [1/s] at which a distance between the ends goes, which waves alone would keep


class _Waves:
    """Impedance B of a connection, as its settings have it, and the root of 2 B, shape (p,)."""

    _settings: LinkSettings
    _metric: Array

    @cached_property
    def _impedance(self) -> Array:
        return self._settings.impedance * self._metric

    @cached_property
    def _root(self) -> Array:
        return np.asarray(np.sqrt(2.0 * self._impedance))


class WaveDevice(_Waves, ObservedDevice):
    """The device's end: takes w, answers a velocity with f = sqrt(2 B) w - B v, tells u."""

    def _wanted(self, velocity: Array) -> Array:
        return self._root * self._heard - self._impedance * velocity

    def _told(self, force: Array, way: Array, motion: Reference) -> Array:
        """The wave of the force that acted and of the mean velocity of the tick."""
        return (self._impedance * (way / self._period) - force) / self._root


class WaveTeam(_Waves, ObservedTeam):
    """The team's end: takes u, answers a force with v = (sqrt(2 B) u - F) / B, tells w.

    The answer is smoothed with the link's bandwidth, since the force follows it at once through
    the damping. A position that was sent along is caught up with.
    """

    def resume(self, start: Reference) -> None:
        """Starts from where the device is now, without a wave under way."""
        self._now, self._heard = start, (start.position, np.zeros_like(start.velocity))

    def _wanted(self, feedback: Array) -> Array:
        position, wave = self._heard
        away = self._layout.difference(position, self._now.position)
        goal = (self._root * wave + feedback) / self._impedance + CATCH_UP * away
        share = self._period * self._settings.bandwidth
        return self._now.velocity + share * (goal - self._now.velocity)

    def _told(self, feedback: Array) -> Array:
        return (self._impedance * self._now.velocity + feedback) / self._root
