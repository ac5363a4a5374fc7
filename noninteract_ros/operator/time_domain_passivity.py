# SPDX-License-Identifier: Apache-2.0
"""Both ends of a connection with a passivity observer and a passivity controller each.

The device's end has the velocity given and answers with a force, the team's end has the force
given and answers with a velocity. Each observes the energy at its port, tick by tick with the
displacement that really happened, and gives away no more than the other end has announced
(`energy_budget.py`): it takes the part along the given flow off its answer. What the team's end
takes up is announced only as far as it was put in before. So the operator gets no more energy out
than was put in and the reserve, whatever the team does. What the hand does within a tick, after
the device's end has chosen its force, may overdraw that by a debt, which its next energy pays.
"""

import math

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.reference import Reference
from noninteract_ros.operator.energy_budget import Budget, Newest, Packet
from noninteract_ros.operator.link_settings import LinkSettings
from noninteract_ros.operator.port import Port, without_excess
from noninteract_ros.subtasks.layout import Layout


class ObservedDevice:
    """The device's end.

    Args:
        settings: The connection.
        metric: Damping of each coordinate in units of that of a plain one, shape (p,).
        period: Tick [s].

    Attributes:
        port: Energy exchanged with the hand.
        budget: What may be given to the hand.
    """

    def __init__(self, settings: LinkSettings, metric: Array, period: float) -> None:
        self._metric, self._period = metric, period
        self._reserve, self._filling = settings.reserve, settings.filling
        observed = settings.passivity != "none"
        self.budget = Budget(0.0 if observed else math.inf, settings.capacity)
        self.port = Port()
        self._newest = Newest()
        self._feedback: Array = np.zeros_like(metric)
        self._team_level = settings.reserve
        self._announced = 0.0
        self._number = 0

    def hear(self, packet: Packet) -> None:
        """Takes a packet of the team's end."""
        self.budget.announce(packet.energy)
        if self._newest.is_newer(packet):
            (self._feedback,), self._team_level = packet.signals, packet.level

    def force(self, velocity: Array) -> Array:
        """Force on the hand for the next tick [N; N m], for the velocity at its beginning."""
        force = self._feedback
        if self._team_level < self._reserve:
            force = force - self._filling * self._metric * velocity
        limit = max(self.budget.level, 0.0) / self._period
        return without_excess(force, velocity, self._metric, limit)

    def moved(self, force: Array, way: Array, motion: Reference) -> Packet:
        """Observes what a force did over a displacement that led to a motion.

        What the hand puts in makes good an overdrawn budget before it is announced.
        """
        work = float(force @ way)
        self.port.give(work)
        if work > 0.0:
            self.budget.level -= work
        else:
            self._announced += self.budget.repay(-work)
        self._number += 1
        signals = motion.position, motion.velocity
        return Packet(self._number, signals, self._announced, self.budget.level)


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
        self._layout, self._metric, self._period = layout, metric, period
        self._bandwidth = settings.bandwidth
        observed = settings.passivity != "none"
        self.budget = Budget(settings.reserve if observed else math.inf, settings.capacity)
        self.port = Port()
        self._newest = Newest()
        self._now, self._heard = start, (start.position, start.velocity)
        self._announced = 0.0
        self._number = 0

    def hear(self, packet: Packet) -> None:
        """Takes a packet of the device's end."""
        self.budget.announce(packet.energy)
        if self._newest.is_newer(packet):
            position, velocity = packet.signals
            self._heard = position, velocity

    def packet(self, feedback: Array) -> Packet:
        """What the device's end is to know, with the feedback of now [N; N m]."""
        self._number += 1
        return Packet(self._number, (feedback,), self._announced, self.budget.level)

    def advance(self, feedback: Array) -> Reference:
        """The team's reference one tick later.

        It follows the newest motion that has arrived, critically damped, as far as the budget
        lets it move against the impedance. It asks for no acceleration: what the law feeds forward
        for one comes out of no account, and makes the team's port active (`docs/derivations.md`).

        Args:
            feedback: Force that the impedance reflects [N; N m]; its opposite moves the team.
        """
        wanted = self._smoothed()
        force = -feedback
        limit = max(self.budget.level, 0.0) / self._period
        velocity = without_excess(wanted, force, 1.0 / self._metric, limit)
        way = self._period * velocity
        self._observe(float(force @ way))
        still = np.zeros_like(velocity)
        self._now = Reference(self._layout.sum(self._now.position, way), velocity, still)
        return self._now

    def _smoothed(self) -> Array:
        """Velocity one tick later of a critically damped follower of what was heard."""
        position, velocity = self._heard
        w, T = self._bandwidth, self._period
        away = self._layout.difference(position, self._now.position)
        pull = w * w * away + 2.0 * w * (velocity - self._now.velocity)
        return self._now.velocity + T * pull

    def _observe(self, work: float) -> None:
        self.port.give(work)
        if work > 0.0:
            self.budget.level -= work
        else:
            self._announced = min(self._announced - work, self.port.given)
