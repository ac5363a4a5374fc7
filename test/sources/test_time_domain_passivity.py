# SPDX-License-Identifier: Apache-2.0
"""Passivity observers and controllers: no end delivers more than the other has reported."""

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


def test_a_budget_is_independent_of_lost_late_and_repeated_counts() -> None:
    """Any subset of counts, in any order, adds the largest of them."""
    rng = np.random.default_rng(1)
    counts = rng.uniform(0.0, 5.0, 50)
    budget = Budget(0.25, 100.0)
    for count in [*counts, *counts[:10], 0.0]:
        budget.receive(count)
    assert budget.level == pytest.approx(0.25 + counts.max())


def test_a_budget_discards_energy_above_its_capacity() -> None:
    """Energy stored over a long time does not accumulate."""
    budget = Budget(0.0, 1.0)
    budget.receive(7.0)
    assert budget.level == 1.0
    budget.level -= 0.5
    budget.receive(7.25)
    assert budget.level == pytest.approx(0.75)


def test_saving_covers_overdraft_and_kept_energy_first() -> None:
    """Energy first covers the overdraft, then the kept level; the rest is returned."""
    budget = Budget(0.0, 1.0)
    budget.level = -0.3
    assert budget.save(0.2, 0.05) == 0.0
    assert budget.save(0.2, 0.05) == pytest.approx(0.05)
    assert budget.level == pytest.approx(0.05)
    assert budget.save(0.2, 0.0) == 0.2


def test_excess_power_is_removed_along_the_flow_only() -> None:
    """Power is limited, the part across the flow is kept, and smaller powers pass unchanged."""
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


def test_norm_limits_keep_the_direction() -> None:
    """5 N become 2 N in the same direction; other components and smaller forces are kept."""
    force = np.array([3.0, 4.0, 7.0])
    np.testing.assert_allclose(limit_norm(force, np.array([0, 1]), 2.0), [1.2, 1.6, 7.0])
    assert limit_norm(force, np.array([0, 1]), 5.0) is force
    assert limit_norm(force, np.array([0, 1]), 0.0) is force


class RandomLink:
    """Both ends connected by channels, with a random hand and a random team, neither passive."""

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
        """Run for some ticks; record the least balance and the largest overdraft."""
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
        displacement = PERIOD * velocity
        place = self._layout.sum(self._hand.position, displacement)
        self._hand = Reference(place, velocity, np.zeros_like(velocity))
        self._there.send(now + PERIOD, self.device.observe(force, displacement, self._hand))
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
def test_energy_received_is_bounded_for_any_hand_and_team(
    settings: LinkSettings, layout: Layout
) -> None:
    """The operator's balance stays above -reserve.

    The hand's velocity is held over a tick here, so that the device's prediction is exact.
    """
    link = RandomLink(settings, layout, 7)
    link.run(6000)
    assert link.least >= -settings.reserve - 1e-9
    assert link.overdraft <= 1e-9
    team = link.team.port
    assert team.delivered <= link.device.port.absorbed + settings.reserve + 1e-9
    assert team.delivered > 0.0  # Energy was exchanged.
    assert link.device.port.delivered > 0.0


def test_without_passivity_the_bound_is_broken() -> None:
    """Without observers the same link draws more than ten times the reserve."""
    settings = LinkSettings(delay=0.2, jitter=0.3, loss=0.05, seed=2, passivity="none")
    link = RandomLink(settings, Layout.scalars(2), 7)
    link.run(6000)
    assert link.least < -10.0 * settings.reserve


def test_with_a_full_budget_the_ends_change_nothing() -> None:
    """Feedback reaches the hand unchanged, and the reference converges to the hand's position."""
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


def test_an_overtaken_packet_is_ignored() -> None:
    """The reference follows the newest packet, not the last one to arrive."""
    layout = Layout.scalars(1)
    team = ObservedTeam(LinkSettings(), layout, np.ones(1), PERIOD, Reference.at_rest([0.0]))
    for number, place in ((2, 0.2), (1, 0.1)):
        team.receive(Packet(number, (np.array([place]), np.zeros(1)), 0.0, 0.0))
    for _ in range(500):
        reference = team.advance(np.zeros(1))
    assert reference.position[0] == pytest.approx(0.2, abs=1e-6)


def test_damping_at_the_hand_fills_the_budget_of_the_team() -> None:
    """While the team's end is below its reserve the device adds damping and reports its energy."""
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
