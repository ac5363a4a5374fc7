# SPDX-License-Identifier: Apache-2.0
"""Ends of a link with a passivity observer and a passivity controller each.

The device's end responds to a velocity with a force, the team's end to a force with a velocity.
Each observes the energy at its port, tick by tick with the measured displacement, and delivers no
more than the other end has reported as absorbed (`energy_budget.py`). The team's end reports
absorbed energy only up to the energy delivered there before. So the operator receives no more
energy than the operator has put in, plus the reserve, for any behaviour of the team.

The device's end has to choose its force before the hand moves. It applies the nearest force that
the budget covers even if the displacement deviates from the predicted one by the largest
prediction error so far. Only a tick with a larger error can overdraw the budget, by its force
times the growth of the largest error. Over all time that is at most the largest force times the
largest prediction error of one tick, for any hand, team and network (`docs/derivations.md`).
"""

import math
from collections.abc import Callable

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.sources.link.energy_budget import Budget, Packet, PacketOrder
from noninteract_ros.sources.link.settings import LinkSettings
from noninteract_ros.sources.port import Port, limit_power, limit_work
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference

Limiter = Callable[[Array], Array]


def _unlimited(force: Array) -> Array:
    return force


class ObservedDevice:
    """Device's end of the link.

    Args:
        settings: Settings of the link.
        metric: Damping of each coordinate relative to that of a translation, shape (p,).
        period: Tick [s].
        saturate: Function that limits a force to the device's force and torque limits.

    Attributes:
        port: Energy exchanged with the hand.
        budget: Energy that may be delivered to the hand.
        uncertainty: Largest prediction error of a displacement so far [m]; rotations are weighted
            by the root of the metric.
        surprise: Bound of the overdraft by prediction errors since the start [J].
    """

    def __init__(
        self,
        settings: LinkSettings,
        metric: Array,
        period: float,
        saturate: Limiter = _unlimited,
    ) -> None:
        self._settings, self._metric = settings, metric
        self._period, self._saturate = period, saturate
        observed = settings.passivity != "none"
        self.budget = Budget(0.0 if observed else math.inf, settings.capacity)
        self.port = Port()
        self.uncertainty = self.surprise = 0.0
        self._order = PacketOrder()
        self._received: Array = np.zeros_like(metric)
        self._expected: Array = np.zeros_like(metric)
        self._team_level = settings.reserve
        self._reported = 0.0
        self._number = 0

    def resume(self) -> None:
        """Re-establish the link: discard received signals, keep all energies."""
        self._received = np.zeros_like(self._metric)

    def receive(self, packet: Packet) -> None:
        """Receive a packet of the team's end."""
        self.budget.receive(packet.energy)
        if self._order.accept(packet):
            (self._received,), self._team_level = packet.signals, packet.level

    def force(self, velocity: Array) -> Array:
        """Return the force on the hand for the next tick [N; N m], given the present velocity."""
        self._expected = self._period * velocity
        limit = max(self.budget.level, 0.0)
        wanted = self._saturate(self._wanted(velocity))
        force = limit_work(wanted, self._expected, self._metric, self.uncertainty, limit)
        return self._scaled(force)

    def observe(self, force: Array, displacement: Array, motion: Reference) -> Packet:
        """Count the work of a force over a displacement, and return the packet to send.

        The first part of the absorbed energy is kept for the device's own oscillations.

        Args:
            force: Force that acted over the tick, shape (p,) [N; N m].
            displacement: Measured displacement, shape (p,) [m; rad].
            motion: Motion at the end of the tick.
        """
        self._update_uncertainty(force, displacement)
        work = float(force @ displacement)
        self.port.add(work)
        if work > 0.0:
            self.budget.level -= work
        else:
            self._reported += self.budget.save(-work, self._settings.kept)
        self._number += 1
        signals = motion.position, self._signal(force, displacement, motion)
        return Packet(self._number, signals, self._reported, self.budget.level)

    def _wanted(self, velocity: Array) -> Array:
        """Return the force without the energy limit [N; N m]."""
        if self._team_level >= self._settings.reserve:
            return self._received
        return self._received - self._settings.filling * self._metric * velocity

    def _signal(self, force: Array, displacement: Array, motion: Reference) -> Array:
        """Return the signal that is sent besides the position."""
        return motion.velocity

    def _scaled(self, force: Array) -> Array:
        """Scale a force to the device's limits as a whole.

        Cutting single components could turn a resisting force into a driving one.
        """
        saturated = self._saturate(force)
        if saturated is force:
            return force
        shares = saturated[force != 0.0] / force[force != 0.0]
        return force * shares.min()

    def _update_uncertainty(self, force: Array, displacement: Array) -> None:
        error = displacement - self._expected
        size = math.sqrt(float(error @ (self._metric * error)))
        if size > self.uncertainty:
            length = math.sqrt(float(force @ (force / self._metric)))
            self.surprise += length * (size - self.uncertainty)
            self.uncertainty = size


class ObservedTeam:
    """Team's end of the link.

    Args:
        settings: Settings of the link.
        layout: Layout of the commanded subtask's values.
        metric: Damping of each coordinate relative to that of a translation, shape (p,).
        period: Tick [s].
        start: Initial motion of the device.

    Attributes:
        port: Energy exchanged with the team's impedance.
        budget: Energy that may be delivered to the team's impedance.
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
        self._order = PacketOrder()
        self.resume(start)
        self._reported = 0.0
        self._number = 0

    def resume(self, start: Reference) -> None:
        """Start at the device's present motion with the remaining energy."""
        self._now, self._received = start, (start.position, start.velocity)

    def receive(self, packet: Packet) -> None:
        """Receive a packet of the device's end."""
        self.budget.receive(packet.energy)
        if self._order.accept(packet):
            position, velocity = packet.signals
            self._received = position, velocity

    def packet(self, feedback: Array) -> Packet:
        """Return the packet to send, with the present feedback [N; N m]."""
        self._number += 1
        signals = (self._signal(feedback),)
        return Packet(self._number, signals, self._reported, self.budget.level)

    def advance(self, feedback: Array) -> Reference:
        """Return the team's reference one tick later.

        The reference follows the newest received motion, critically damped, as far as the budget
        allows motion against the impedance. Its acceleration is zero: the feed-forward force of an
        acceleration is in no account and makes the team's port active (`docs/derivations.md`).

        Args:
            feedback: Force that the impedance reflects [N; N m]; its opposite moves the team.
        """
        wanted = self._wanted(feedback)
        force = -feedback
        limit = max(self.budget.level, 0.0) / self._period
        velocity = limit_power(wanted, force, 1.0 / self._metric, limit)
        displacement = self._period * velocity
        self._observe(float(force @ displacement))
        still = np.zeros_like(velocity)
        self._now = Reference(self._layout.sum(self._now.position, displacement), velocity, still)
        return self._now

    def _wanted(self, feedback: Array) -> Array:
        """Return the velocity one tick later of a critically damped follower."""
        position, velocity = self._received
        w, T = self._settings.bandwidth, self._period
        error = self._layout.difference(position, self._now.position)
        pull = w * w * error + 2.0 * w * (velocity - self._now.velocity)
        return self._now.velocity + T * pull

    def _signal(self, feedback: Array) -> Array:
        """Return the signal that is sent."""
        return feedback

    def _observe(self, work: float) -> None:
        self.port.add(work)
        if work > 0.0:
            self.budget.level -= work
        else:
            self._reported = min(self._reported - work, self.port.delivered)
