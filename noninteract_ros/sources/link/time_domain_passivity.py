# SPDX-License-Identifier: Apache-2.0
"""Both ends of a connection with a passivity observer and a passivity controller each.

The device's end has the velocity given and answers with a force, the team's end has the force
given and answers with a velocity. Each observes the energy at its port, tick by tick with the
displacement that really happened, and gives away no more than the other end has announced
(`energy_budget.py`). What the team's end takes up is announced only as far as it was put in
before. So the operator gets no more energy out than was put in and the reserve, whatever the team
does.

The device's end has to choose its force before the hand moves. It answers with the nearest force
that is paid for even if the displacement misses what the velocity foretells by as much as it ever
did. Only a tick that misses by more can overdraw the budget, by its force times the growth of the
greatest miss: over all time no more than the greatest force times the greatest miss of one tick,
whatever hand, team and network do (`docs/derivations.md`).
"""

import math
from collections.abc import Callable

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.sources.link.energy_budget import Budget, Newest, Packet
from noninteract_ros.sources.link.settings import LinkSettings
from noninteract_ros.sources.port import Port, affordable, without_excess
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference

Limiter = Callable[[Array], Array]


def _unlimited(force: Array) -> Array:
    return force


class ObservedDevice:
    """The device's end.

    Args:
        settings: The connection.
        metric: Damping of each coordinate in units of that of a plain one, shape (p,).
        period: Tick [s].
        limited: What the device can do of a force; it shortens parts of it.

    Attributes:
        port: Energy exchanged with the hand.
        budget: What may be given to the hand.
        doubt: By how much displacements have missed what was expected, at most [m]; rotations
            count by the metric's root.
        surprise: How far such misses can have overdrawn the budget since the start [J].
    """

    def __init__(
        self,
        settings: LinkSettings,
        metric: Array,
        period: float,
        limited: Limiter = _unlimited,
    ) -> None:
        self._settings, self._metric = settings, metric
        self._period, self._limited = period, limited
        observed = settings.passivity != "none"
        self.budget = Budget(0.0 if observed else math.inf, settings.capacity)
        self.port = Port()
        self.doubt = self.surprise = 0.0
        self._newest = Newest()
        self._heard: Array = np.zeros_like(metric)
        self._expected: Array = np.zeros_like(metric)
        self._team_level = settings.reserve
        self._announced = 0.0
        self._number = 0

    def resume(self) -> None:
        """Forgets what was heard, but no energy: the connection is taken up again."""
        self._heard = np.zeros_like(self._metric)

    def hear(self, packet: Packet) -> None:
        """Takes a packet of the team's end."""
        self.budget.announce(packet.energy)
        if self._newest.is_newer(packet):
            (self._heard,), self._team_level = packet.signals, packet.level

    def force(self, velocity: Array) -> Array:
        """Force on the hand for the next tick [N; N m], for the velocity at its beginning."""
        self._expected = self._period * velocity
        limit = max(self.budget.level, 0.0)
        wanted = self._limited(self._wanted(velocity))
        force = affordable(wanted, self._expected, self._metric, self.doubt, limit)
        return self._shrunk(force)

    def moved(self, force: Array, way: Array, motion: Reference) -> Packet:
        """Observes what a force did over a displacement that led to a motion.

        Of what the hand puts in, the end keeps enough for its own swings before it announces any.
        """
        self._compare(force, way)
        work = float(force @ way)
        self.port.give(work)
        if work > 0.0:
            self.budget.level -= work
        else:
            self._announced += self.budget.keep(-work, self._settings.kept)
        self._number += 1
        signals = motion.position, self._told(force, way, motion)
        return Packet(self._number, signals, self._announced, self.budget.level)

    def _wanted(self, velocity: Array) -> Array:
        """The force that would be felt if energy were no matter [N; N m]."""
        if self._team_level >= self._settings.reserve:
            return self._heard
        return self._heard - self._settings.filling * self._metric * velocity

    def _told(self, force: Array, way: Array, motion: Reference) -> Array:
        """What the other end gets to know besides the position."""
        return motion.velocity

    def _shrunk(self, force: Array) -> Array:
        """What the device can do of a force, in its direction: cut in parts it might drive."""
        able = self._limited(force)
        if able is force:
            return force
        shares = able[force != 0.0] / force[force != 0.0]
        return force * shares.min()

    def _compare(self, force: Array, way: Array) -> None:
        miss = way - self._expected
        size = math.sqrt(float(miss @ (self._metric * miss)))
        if size > self.doubt:
            grip = math.sqrt(float(force @ (force / self._metric)))
            self.surprise += grip * (size - self.doubt)
            self.doubt = size


class ObservedTeam:
    """The team's end.

    Args:
        settings: The connection.
        layout: Layout of the commanded subtask's values.
        metric: As for the device's end.
        period: Tick [s].
        start: Where the device is at first.

    Attributes:
        port: Energy exchanged with the team's impedance.
        budget: What may be given to it.
    """

    def __init__(
        self,
        settings: LinkSettings,
        layout: Layout,
        metric: Array,
        period: float,
        start: Reference,
    ) -> None:
        self._settings, self._layout = settings, layout
        self._metric, self._period = metric, period
        observed = settings.passivity != "none"
        self.budget = Budget(settings.reserve if observed else math.inf, settings.capacity)
        self.port = Port()
        self._newest = Newest()
        self.resume(start)
        self._announced = 0.0
        self._number = 0

    def resume(self, start: Reference) -> None:
        """Starts from where the device is now, with the energy that there is."""
        self._now, self._heard = start, (start.position, start.velocity)

    def hear(self, packet: Packet) -> None:
        """Takes a packet of the device's end."""
        self.budget.announce(packet.energy)
        if self._newest.is_newer(packet):
            position, velocity = packet.signals
            self._heard = position, velocity

    def packet(self, feedback: Array) -> Packet:
        """What the device's end is to know, with the feedback of now [N; N m]."""
        self._number += 1
        told = self._told(feedback)
        return Packet(self._number, (told,), self._announced, self.budget.level)

    def advance(self, feedback: Array) -> Reference:
        """The team's reference one tick later.

        It follows the newest motion that has arrived, critically damped, as far as the budget
        lets it move against the impedance. It asks for no acceleration: what the law feeds forward
        for one comes out of no account, and makes the team's port active (`docs/derivations.md`).

        Args:
            feedback: Force that the impedance reflects [N; N m]; its opposite moves the team.
        """
        wanted = self._wanted(feedback)
        force = -feedback
        limit = max(self.budget.level, 0.0) / self._period
        velocity = without_excess(wanted, force, 1.0 / self._metric, limit)
        way = self._period * velocity
        self._observe(float(force @ way))
        still = np.zeros_like(velocity)
        self._now = Reference(self._layout.sum(self._now.position, way), velocity, still)
        return self._now

    def _wanted(self, feedback: Array) -> Array:
        """Velocity one tick later of a critically damped follower of what was heard."""
        position, velocity = self._heard
        w, T = self._settings.bandwidth, self._period
        away = self._layout.difference(position, self._now.position)
        pull = w * w * away + 2.0 * w * (velocity - self._now.velocity)
        return self._now.velocity + T * pull

    def _told(self, feedback: Array) -> Array:
        """What the other end gets to know."""
        return feedback

    def _observe(self, work: float) -> None:
        self.port.give(work)
        if work > 0.0:
            self.budget.level -= work
        else:
            self._announced = min(self._announced - work, self.port.given)
