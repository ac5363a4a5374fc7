# SPDX-License-Identifier: Apache-2.0
"""What the operator can ever get out: the reserve, and one tick's surprise that never adds up."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from adversary import Deaf, Hand, Loop, greedy, jerky, liar, tremor

from noninteract_ros.arrays import Array
from noninteract_ros.sources.link.channel import Channel
from noninteract_ros.sources.link.energy_budget import Packet
from noninteract_ros.sources.link.settings import LinkSettings
from noninteract_ros.sources.link.time_domain_passivity import ObservedDevice, ObservedTeam
from noninteract_ros.sources.link.wave_variables import WaveDevice, WaveTeam
from noninteract_ros.sources.port import limit_power, limit_work
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference

PLANE, POSE = Layout.scalars(2), Layout((3,), (True,))
TICKS = 2000
ROUNDING = 1e-9  # [J]
HANDS: dict[str, Callable[[int], Hand]] = {
    "tremor at 10 Hz": lambda dim: tremor(dim, 10.0),
    "tremor at the sixth of the rate": lambda dim: tremor(dim, 1000.0 / 6.0),
    "tremor near half the rate": lambda dim: tremor(dim, 497.0),
    "greedy": greedy,
    "liar": liar,
    "jerky": jerky,
}
NETWORKS: dict[str, LinkSettings] = {
    "none": LinkSettings(),
    "jitter": LinkSettings(delay=0.05, jitter=1.0, loss=0.3, seed=1),
    "long": LinkSettings(delay=0.2, jitter=0.3, loss=0.05, seed=2, reserve=0.0),
    "in order": LinkSettings(delay=0.1, jitter=0.5, reordering=False, seed=3, kept=0.0),
}


def network(settings: LinkSettings) -> tuple[Channel[Packet], Channel[Packet]]:
    """Both directions as a scenario has them."""
    return Channel(settings, 0), Channel(settings, 1)


def holds(loop: Loop, settings: LinkSettings) -> None:
    """The bound that derivations.md proves, each of its steps by itself."""
    surprise = loop.device.surprise
    assert loop.debt <= surprise + ROUNDING
    assert loop.least >= -(settings.reserve + surprise) - ROUNDING
    assert loop.device.uncertainty == pytest.approx(loop.miss)
    assert surprise <= loop.force * loop.miss + ROUNDING
    taken, given = loop.device.port.absorbed, loop.team.port.delivered
    assert given <= taken + settings.reserve + ROUNDING


@pytest.mark.parametrize(
    ("name", "layout"), [("none", PLANE), ("jitter", POSE), ("long", POSE), ("in order", PLANE)]
)
@pytest.mark.parametrize("hand", HANDS.values(), ids=HANDS)
def test_no_hand_gets_out_more_than_the_reserve_and_one_tick_s_surprise(
    hand: Callable[[int], Hand], name: str, layout: Layout
) -> None:
    """Thousands of ticks, each of which could overdraw: together no more than the worst one."""
    settings = NETWORKS[name]
    loop = Loop(settings, layout, hand(layout.dim), network(settings)).run(TICKS)
    holds(loop, settings)
    assert loop.device.port.delivered > 0.0  # Something was felt.


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("hand", [greedy, jerky], ids=["greedy", "jerky"])
def test_nor_does_a_network_of_bursts_that_repeats_and_shuffles(
    hand: Callable[[int], Hand], seed: int
) -> None:
    """Silence of up to 0.4 s, then all at once, twice and in any order, or half of it never."""
    settings = LinkSettings()
    deaf = Deaf(np.random.default_rng(seed)), Deaf(np.random.default_rng(100 + seed))
    holds(Loop(settings, POSE, hand(6), deaf).run(TICKS), settings)


@pytest.mark.parametrize("name", ["jitter", "long"])
@pytest.mark.parametrize("hand", [greedy, jerky, liar], ids=["greedy", "jerky", "liar"])
def test_waves_are_held_to_the_same_bound(hand: Callable[[int], Hand], name: str) -> None:
    """Over networks that vary, in which waves alone are not passive."""
    settings = replace(NETWORKS[name], passivity="waves")
    ends = WaveDevice, WaveTeam
    loop = Loop(settings, POSE, hand(6), network(settings), ends=ends).run(TICKS)
    holds(loop, settings)
    assert loop.device.port.delivered + loop.device.port.absorbed > 0.0


class Trusting(ObservedDevice):
    """A device's end that takes the displacement that its velocity foretells for certain."""

    def _update_uncertainty(self, force: Array, displacement: Array) -> None:
        return None


@pytest.mark.parametrize("name", ["tremor near half the rate", "greedy", "liar"])
def test_a_device_that_trusts_its_velocity_gives_away_more(name: str) -> None:
    """The bound is the doubt's doing: the same hands break it at once without."""
    settings = LinkSettings(delay=0.05, jitter=0.3, loss=0.05, kept=0.0)
    hand = HANDS[name](2)
    ends = Trusting, ObservedTeam
    loop = Loop(settings, PLANE, hand, network(settings), ends=ends).run(TICKS)
    assert loop.least < -(settings.reserve + loop.force * loop.miss)


def test_the_surprise_falls_with_the_square_of_the_tick() -> None:
    """A hand of bounded acceleration a misses by a T^2 / 2: a quarter of it at half the tick."""
    settings, a = LinkSettings(delay=0.05, jitter=0.3, loss=0.05), 50.0
    for period in (1e-3, 5e-4):
        hand = greedy(2, period, a)
        loop = Loop(settings, PLANE, hand, network(settings), period).run(round(5.0 / period))
        holds(loop, settings)
        assert loop.device.uncertainty == pytest.approx(0.5 * a * period**2)
        assert loop.debt <= loop.force * 0.5 * a * period**2 + ROUNDING


def test_the_force_is_the_nearest_that_can_be_paid_for() -> None:
    """Feasible, and no other feasible force is nearer: the optimum's variational inequality."""
    rng = np.random.default_rng(4)
    metric = np.array([1.0, 1.0, 0.02])
    cut = 0
    for _ in range(400):
        effort, way, other = rng.normal(size=(3, 3))
        doubt, limit = rng.choice([0.0, 0.3, 1.0, 3.0]), rng.choice([0.0, 0.2, 1.0])

        def worst(force: Array, way: Array = way, doubt: float = doubt) -> float:
            return float(force @ way) + doubt * np.sqrt(float(force @ (force / metric)))

        found = limit_work(effort, way, metric, doubt, limit)
        assert worst(found) <= limit + 1e-9
        if found is effort:
            continue
        cut += 1
        for scale in (0.01, 0.1, 1.0):
            rival = limit_work(found + scale * other, way, metric, doubt, limit)
            assert worst(rival) <= limit + 1e-9
            assert (effort - found) @ ((rival - found) / metric) <= 1e-7
    assert cut > 200


def test_without_doubt_it_is_the_passivity_controller_s_damping() -> None:
    """A displacement that is certain costs damping along it and nothing else."""
    rng = np.random.default_rng(6)
    metric = np.array([1.0, 0.02])
    for effort, way in rng.normal(size=(50, 2, 2)):
        found = limit_work(effort, way, metric, 0.0, 0.1)
        np.testing.assert_allclose(found, limit_power(effort, way, metric, 0.1), atol=1e-9)


def test_with_nothing_to_spend_a_hand_at_rest_feels_nothing_and_a_moving_one_resistance() -> None:
    """Nothing is left: only what is sure to oppose the motion remains."""
    push, metric = np.array([3.0, 1.0]), np.ones(2)
    np.testing.assert_array_equal(limit_work(push, np.zeros(2), metric, 0.1, 0.0), 0.0)
    found = limit_work(push, np.array([-1.0, 0.0]), metric, 0.1, 0.0)
    assert found[0] == pytest.approx(3.0, rel=0.1)
    assert found[1] == pytest.approx(1.0, rel=0.1)
    with_it = limit_work(push, np.array([1.0, 0.0]), metric, 0.1, 0.0)
    assert with_it @ np.array([1.0, 0.0]) + 0.1 * np.linalg.norm(with_it) <= 1e-12


def test_a_device_that_can_do_less_does_not_drive_with_what_is_left() -> None:
    """A torque limit must not take away the resistance that paid for the force."""

    def limited(force: Array) -> Array:
        able = force.copy()
        able[1] = np.clip(able[1], -0.1, 0.1)
        return force if abs(force[1]) <= 0.1 else able

    device = ObservedDevice(LinkSettings(), np.ones(2), 1e-3, limited)
    velocity = np.array([0.1, 1.0])
    device.receive(Packet(1, (np.array([5.0, -0.05]),), 0.0, 0.1))
    force = device.force(velocity)
    assert abs(force[1]) <= 0.1
    assert force @ velocity <= 1e-12
    device.observe(force, 1e-3 * velocity, Reference.at_rest(np.zeros(2)))
    assert device.port.delivered <= 1e-15
