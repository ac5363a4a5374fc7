# SPDX-License-Identifier: Apache-2.0
"""Passivity observers and controllers: no end gives away what the other has not announced."""

import numpy as np
import pytest

from noninteract_ros.arrays import Array
from noninteract_ros.sources.link.channel import Channel
from noninteract_ros.sources.link.energy_budget import Budget, Packet
from noninteract_ros.sources.link.settings import LinkSettings
from noninteract_ros.sources.link.time_domain_passivity import ObservedDevice, ObservedTeam
from noninteract_ros.sources.port import limit_norm, limit_power
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference

PERIOD = 1e-3
POSE = Layout((3,), (True,))


def test_a_budget_counts_what_is_new_whatever_is_lost_late_or_repeated() -> None:
    """Any subset of counts, in any order, brings the greatest of them and no more."""
    rng = np.random.default_rng(1)
    counts = rng.uniform(0.0, 5.0, 50)
    budget = Budget(0.25, 100.0)
    for count in [*counts, *counts[:10], 0.0]:
        budget.receive(count)
    assert budget.level == pytest.approx(0.25 + counts.max())


def test_a_budget_forgoes_what_is_beyond_its_capacity() -> None:
    """Energy saved over a long time does not pile up."""
    budget = Budget(0.0, 1.0)
    budget.receive(7.0)
    assert budget.level == 1.0
    budget.level -= 0.5
    budget.receive(7.25)
    assert budget.level == pytest.approx(0.75)


def test_debts_are_paid_and_some_is_kept_before_anything_is_left() -> None:
    """An overdrawn budget takes the energy first, then what it is to keep."""
    budget = Budget(0.0, 1.0)
    budget.level = -0.3
    assert budget.save(0.2, 0.05) == 0.0
    assert budget.save(0.2, 0.05) == pytest.approx(0.05)
    assert budget.level == pytest.approx(0.05)
    assert budget.save(0.2, 0.0) == 0.2


def test_excess_is_taken_off_along_the_flow_and_nothing_else() -> None:
    """Power ends at the limit, what is across the flow stays, and less than the limit passes."""
    rng = np.random.default_rng(2)
    metric = np.array([1.0, 1.0, 0.02])
    for _ in range(100):
        effort, flow = rng.normal(size=(2, 3))
        limit = rng.uniform(0.0, 2.0)
        found = limit_power(effort, flow, metric, limit)
        assert found @ flow <= max(limit, 0.0) + 1e-12 or effort @ flow <= limit
        if effort @ flow <= limit:
            assert found is effort
        else:
            assert found @ flow == pytest.approx(limit)
            assert np.linalg.matrix_rank([found - effort, metric * flow], tol=1e-9) == 1


def test_limits_shorten_and_keep_the_direction() -> None:
    """A force of 5 N becomes 2 N the same way; other places and shorter forces stay."""
    force = np.array([3.0, 4.0, 7.0])
    np.testing.assert_allclose(limit_norm(force, np.array([0, 1]), 2.0), [1.2, 1.6, 7.0])
    assert limit_norm(force, np.array([0, 1]), 5.0) is force
    assert limit_norm(force, np.array([0, 1]), 0.0) is force


class Adversary:
    """Both ends joined by channels, with any hand and any team: neither is passive.

    The hand moves and the team pushes at random, with a bias for what draws energy.
    """

    def __init__(self, settings: LinkSettings, layout: Layout, seed: int) -> None:
        metric = np.ones(layout.dim)
        self._rng = np.random.default_rng(seed)
        self._layout = layout
        start = Reference.at_rest(layout.identity, layout)
        self.device = ObservedDevice(settings, metric, PERIOD)
        self.team = ObservedTeam(settings, layout, metric, PERIOD, start)
        self._there: Channel[Packet] = Channel(settings, 0)
        self._back: Channel[Packet] = Channel(settings, 1)
        self._hand = start
        self.least, self.overdraft = 0.0, 0.0

    def run(self, ticks: int) -> None:
        """Lets both do their worst."""
        dim = self._layout.dim
        velocity, feedback = np.zeros(dim), np.zeros(dim)
        for tick in range(ticks):
            if tick % 20 == 0:
                target, feedback = self._rng.normal(size=dim), 20.0 * self._rng.normal(size=dim)
            self._tick(tick * PERIOD, velocity, feedback)
            velocity = velocity + 0.05 * (target - velocity)
            net = self.device.port.absorbed - self.device.port.delivered
            self.least = min(self.least, net)
            self.overdraft = max(self.overdraft, -self.device.budget.level)

    def _tick(self, now: float, velocity: Array, feedback: Array) -> None:
        self._back.send(now, self.team.packet(feedback))
        for packet in self._back.receive(now):
            self.device.receive(packet)
        force = self.device.force(velocity)
        way = PERIOD * velocity
        place = self._layout.sum(self._hand.position, way)
        self._hand = Reference(place, velocity, np.zeros_like(velocity))
        self._there.send(now + PERIOD, self.device.observe(force, way, self._hand))
        for packet in self._there.receive(now + PERIOD):
            self.team.receive(packet)
        self.team.advance(feedback)


LINKS = [
    LinkSettings(),
    LinkSettings(delay=0.05, jitter=0.3, loss=0.05, seed=1),
    LinkSettings(delay=0.2, jitter=0.3, loss=0.05, seed=2),
    LinkSettings(delay=0.1, jitter=1.0, loss=0.5, seed=3, reserve=0.0),
]


@pytest.mark.parametrize("layout", [Layout.scalars(2), POSE], ids=["plane", "pose"])
@pytest.mark.parametrize("settings", LINKS)
def test_nobody_gets_more_out_than_was_put_in_whatever_hand_and_team_do(
    settings: LinkSettings, layout: Layout
) -> None:
    """Against the worst of hands and teams: the operator's account stays above -reserve.

    The hand's velocity is held over a tick here, so that the device's prediction is exact.
    """
    adversary = Adversary(settings, layout, 7)
    adversary.run(6000)
    assert adversary.least >= -settings.reserve - 1e-9
    assert adversary.overdraft <= 1e-9
    team = adversary.team.port
    assert team.given <= adversary.device.port.absorbed + settings.reserve + 1e-9
    assert team.given > 0.0  # Something passed.
    assert adversary.device.port.delivered > 0.0


def test_without_passivity_the_same_adversary_draws_what_it_likes() -> None:
    """The bound above is the observers' doing."""
    settings = LinkSettings(delay=0.2, jitter=0.3, loss=0.05, seed=2, passivity="none")
    adversary = Adversary(settings, Layout.scalars(2), 7)
    adversary.run(6000)
    assert adversary.least < -10.0 * settings.reserve


def test_with_a_full_budget_the_ends_change_nothing() -> None:
    """Feedback reaches the hand as it is, and the reference goes where the hand is, at rest."""
    layout = POSE
    settings = LinkSettings(reserve=100.0, capacity=100.0)
    start = Reference.at_rest(layout.identity, layout)
    team = ObservedTeam(settings, layout, np.ones(6), PERIOD, start)
    device = ObservedDevice(settings, np.ones(6), PERIOD)
    feedback = np.array([1.0, -2.0, 3.0, 0.1, 0.2, -0.3])
    device.receive(Packet(1, (feedback,), 50.0, 100.0))
    np.testing.assert_array_equal(device.force(np.full(6, 0.3)), feedback)
    goal = layout.sum(layout.identity, np.array([0.1, 0.2, -0.1, 0.3, -0.2, 0.1]))
    team.receive(Packet(1, (goal, np.zeros(6)), 0.0, 0.0))
    for _ in range(500):
        reference = team.advance(feedback)
    np.testing.assert_allclose(layout.difference(reference.position, goal), 0.0, atol=1e-6)


def test_an_overtaken_packet_brings_no_old_motion() -> None:
    """The newest counts, not the last to arrive."""
    layout = Layout.scalars(1)
    team = ObservedTeam(LinkSettings(), layout, np.ones(1), PERIOD, Reference.at_rest([0.0]))
    for number, place in ((2, 0.2), (1, 0.1)):
        team.receive(Packet(number, (np.array([place]), np.zeros(1)), 0.0, 0.0))
    for _ in range(500):
        reference = team.advance(np.zeros(1))
    assert reference.position[0] == pytest.approx(0.2, abs=1e-6)


def test_the_hand_fills_the_budget_of_the_team() -> None:
    """While the team's end has less than its reserve the device resists, and that is announced."""
    settings = LinkSettings(reserve=0.2, filling=10.0, kept=0.001)
    device = ObservedDevice(settings, np.ones(1), PERIOD)
    velocity = np.array([0.5])
    assert device.force(velocity)[0] == 0.0
    device.receive(Packet(1, (np.zeros(1),), 0.0, 0.1))
    force = device.force(velocity)
    assert force[0] == pytest.approx(-5.0)
    packet = device.observe(force, PERIOD * velocity, Reference.at_rest([0.0]))
    assert packet.energy == pytest.approx(0.0015)
    assert packet.level == pytest.approx(0.001)
