# SPDX-License-Identifier: Apache-2.0
"""Both ends of a link between an active hand, a lossy network and an active team."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.sources.link.energy_budget import Packet
from noninteract_ros.sources.link.settings import LinkSettings
from noninteract_ros.sources.link.time_domain_passivity import ObservedDevice, ObservedTeam
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference

FORCE = 20.0  # Largest force of the team [N].
Moved = tuple[Array, Array]
"""Displacement over a tick (p,) and the velocity measured after it (p,)."""

Hand = Callable[[Array], Moved]
"""A hand: its motion in a tick under a known force."""


@dataclass
class BurstNetwork:
    """Network of bursts: nothing arrives for a while, then everything, shuffled and twice."""

    rng: np.random.Generator
    longest: float = 0.4

    def __post_init__(self) -> None:
        self._waiting: list[Packet] = []
        self._until = 0.0

    def send(self, _now: float, packet: Packet) -> None:
        """Store a packet, or lose it."""
        if self.rng.random() > 0.05:
            self._waiting.append(packet)

    def receive(self, now: float) -> Iterator[Packet]:
        """Deliver the stored packets, some of them never, others twice."""
        if now < self._until:
            return
        self._until = now + self.rng.uniform(0.0, self.longest) * (self.rng.random() < 0.2)
        waiting, self._waiting = self._waiting, []
        if self.rng.random() < 0.2:
            waiting = waiting[: len(waiting) // 2]
        for index in self.rng.permutation(np.repeat(np.arange(len(waiting)), 2)):
            yield waiting[index]


class AdversarialLink:
    """Link with a hand and a team that are not passive.

    The team pushes in the direction of the hand's motion, or in a random one.

    Args:
        settings: Settings of the connection.
        layout: Layout of the values.
        hand: Motion of the device.
        network: The two directions.
        period: Tick [s].
        ends: Classes of the device's end and of the team's end.
    """

    def __init__(
        self,
        settings: LinkSettings,
        layout: Layout,
        hand: Hand,
        network: tuple,
        period: float = 1e-3,
        ends: tuple[type[ObservedDevice], type[ObservedTeam]] = (ObservedDevice, ObservedTeam),
    ) -> None:
        metric = np.ones(layout.dim)
        metric[layout.angular] = 0.02
        self._layout, self._hand, self._period = layout, hand, period
        self._there, self._back = network
        self._rng = np.random.default_rng(5)
        self._motion = Reference.at_rest(layout.identity, layout)
        self.device = ends[0](settings, metric, period)
        self.team = ends[1](settings, layout, metric, period, self._motion)
        self._root = np.sqrt(metric)
        self.force = self.error = self.overdraft = self.least = 0.0

    def run(self, ticks: int) -> "AdversarialLink":
        """Run; record largest force, prediction error and overdraft, and the least balance."""
        feedback = np.zeros(self._layout.dim)
        for tick in range(ticks):
            if tick % 20 == 0:
                feedback = self._push()
            self._tick(tick * self._period, feedback)
            self.overdraft = max(self.overdraft, -self.device.budget.level)
            self.least = min(self.least, self.device.port.absorbed - self.device.port.delivered)
        return self

    def _push(self) -> Array:
        push = self._rng.normal(size=self._layout.dim)
        if self._rng.random() < 0.7 and self._motion.velocity.any():
            push = self._motion.velocity * np.sign(self._rng.normal() + 1.0)
        return FORCE * push / np.linalg.norm(push)

    def _tick(self, now: float, feedback: Array) -> None:
        self._back.send(now, self.team.packet(feedback))
        for packet in self._back.receive(now):
            self.device.receive(packet)
        expected = self._period * self._motion.velocity
        force = self.device.force(self._motion.velocity)
        displacement, velocity = self._hand(force)
        self.force = max(self.force, float(np.linalg.norm(force / self._root)))
        self.error = max(self.error, float(np.linalg.norm((displacement - expected) * self._root)))
        place = self._layout.sum(self._motion.position, displacement)
        self._motion = Reference(place, velocity, np.zeros_like(velocity))
        self._there.send(
            now + self._period, self.device.observe(force, displacement, self._motion)
        )
        for packet in self._there.receive(now + self._period):
            self.team.receive(packet)
        self.team.advance(feedback)


def tremor(dim: int, frequency: float, period: float = 1e-3, amplitude: float = 5e-4) -> Hand:
    """Build a hand at near rest with tremor about a slow oscillation."""
    rates = 2.0 * np.pi * frequency * (1.0 + 0.01 * np.arange(dim))
    slow = 2.0 * np.pi * 0.3
    tick = 0

    def motion(t: float) -> Moved:
        x = amplitude * np.sin(rates * t) + 0.01 * np.sin(slow * t)
        v = amplitude * rates * np.cos(rates * t) + 0.01 * slow * np.cos(slow * t)
        return x, v

    def move(_force: Array) -> Moved:
        nonlocal tick
        (before, _), (after, velocity) = motion(tick * period), motion((tick + 1) * period)
        tick += 1
        return after - before, velocity

    return move


def force_following(dim: int, period: float = 1e-3, acceleration: float = 50.0) -> Hand:
    """Build a hand that follows the force of the present tick, within 5 cm and 0.3 m/s."""
    x, v = np.zeros(dim), np.zeros(dim)

    def move(force: Array) -> Moved:
        nonlocal x, v
        pull = force if np.linalg.norm(x) < 0.05 else -x
        length = np.linalg.norm(pull)
        a = acceleration * pull / length if length > 0.0 else -10.0 * v - 50.0 * x
        if np.linalg.norm(v + period * a) > 0.3:
            a = -acceleration * v / np.linalg.norm(v)
        way = period * v + 0.5 * period**2 * a
        x, v = x + way, v + period * a
        return way, v

    return move


def reversed_velocity(dim: int, period: float = 1e-3, speed: float = 0.05) -> Hand:
    """Build a hand that moves with the force but reports the opposite velocity."""
    x = np.zeros(dim)

    def move(force: Array) -> Moved:
        nonlocal x
        length = np.linalg.norm(force)
        goal = force / length if length > 0.0 else -10.0 * x
        way = period * speed * goal
        x = x + way
        return way, -way / period

    return move


def jumping(dim: int, period: float = 1e-3, seed: int = 3) -> Hand:
    """Build a hand with random jumps and random velocities."""
    rng = np.random.default_rng(seed)

    def move(_force: Array) -> Moved:
        scale = 1e-4 * rng.exponential()
        return scale * rng.normal(size=dim), scale / period * rng.normal(size=dim)

    return move
