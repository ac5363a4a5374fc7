# SPDX-License-Identifier: Apache-2.0
"""Bound of the operator's energy: the reserve, plus the prediction error of one tick."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from adversarial_link import (
    AdversarialLink,
    BurstNetwork,
    Hand,
    force_following,
    jumping,
    reversed_velocity,
    tremor,
)

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
    "force_following": force_following,
    "reversed_velocity": reversed_velocity,
    "jumping": jumping,
}
NETWORKS: dict[str, LinkSettings] = {
    "none": LinkSettings(),
    "jitter": LinkSettings(delay=0.05, jitter=1.0, loss=0.3, seed=1),
    "long": LinkSettings(delay=0.2, jitter=0.3, loss=0.05, seed=2, reserve=0.0),
    "in order": LinkSettings(delay=0.1, jitter=0.5, reordering=False, seed=3, kept=0.0),
}


def network(settings: LinkSettings) -> tuple[Channel[Packet], Channel[Packet]]:
    """Build both directions of a connection."""
    return Channel(settings, 0), Channel(settings, 1)


def assert_bound(link: AdversarialLink, settings: LinkSettings) -> None:
    """Check the bound that derivations.md proves, step by step."""
    surprise = link.device.surprise
    assert link.overdraft <= surprise + ROUNDING
    assert link.least >= -(settings.reserve + surprise) - ROUNDING
    assert link.device.uncertainty == pytest.approx(link.error)
    assert surprise <= link.force * link.error + ROUNDING
    taken, given = link.device.port.absorbed, link.team.port.delivered
    assert given <= taken + settings.reserve + ROUNDING


@pytest.mark.parametrize(
    ("name", "layout"), [("none", PLANE), ("jitter", POSE), ("long", POSE), ("in order", PLANE)]
)
@pytest.mark.parametrize("hand", HANDS.values(), ids=HANDS)
def test_no_hand_receives_more_than_the_reserve_and_the_error_of_one_tick(
    hand: Callable[[int], Hand], name: str, layout: Layout
) -> None:
    """Over thousands of ticks the overdraft is at most that of the worst one."""
    settings = NETWORKS[name]
    link = AdversarialLink(settings, layout, hand(layout.dim), network(settings)).run(TICKS)
    assert_bound(link, settings)
    assert link.device.port.delivered > 0.0  # There was feedback.


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("hand", [force_following, jumping], ids=["force_following", "jumping"])
def test_the_bound_holds_over_a_network_of_bursts(hand: Callable[[int], Hand], seed: int) -> None:
    """With gaps of up to 0.4 s, then all packets twice and in any order, or half of them lost."""
    settings = LinkSettings()
    bursts = (
        BurstNetwork(np.random.default_rng(seed)),
        BurstNetwork(np.random.default_rng(100 + seed)),
    )
    assert_bound(AdversarialLink(settings, POSE, hand(6), bursts).run(TICKS), settings)


@pytest.mark.parametrize("name", ["jitter", "long"])
@pytest.mark.parametrize(
    "hand",
    [force_following, jumping, reversed_velocity],
    ids=["force_following", "jumping", "reversed_velocity"],
)
def test_the_bound_holds_for_wave_variables(hand: Callable[[int], Hand], name: str) -> None:
    """Over varying networks, in which wave variables alone are not passive."""
    settings = replace(NETWORKS[name], passivity="waves")
    ends = WaveDevice, WaveTeam
    link = AdversarialLink(settings, POSE, hand(6), network(settings), ends=ends).run(TICKS)
    assert_bound(link, settings)
    assert link.device.port.delivered + link.device.port.absorbed > 0.0


class WithoutUncertainty(ObservedDevice):
    """Device's end that takes the predicted displacement as exact."""

    def _update_uncertainty(self, force: Array, displacement: Array) -> None:
        return None


@pytest.mark.parametrize(
    "name", ["tremor near half the rate", "force_following", "reversed_velocity"]
)
def test_a_device_without_uncertainty_breaks_the_bound(name: str) -> None:
    """The uncertainty gives the bound: without it the same hands break the bound at once."""
    settings = LinkSettings(delay=0.05, jitter=0.3, loss=0.05, kept=0.0)
    hand = HANDS[name](2)
    ends = WithoutUncertainty, ObservedTeam
    link = AdversarialLink(settings, PLANE, hand, network(settings), ends=ends).run(TICKS)
    assert link.least < -(settings.reserve + link.force * link.error)


def test_the_surprise_falls_with_the_square_of_the_tick() -> None:
    """A hand of bounded acceleration a has the error a T^2 / 2: a quarter at half the tick."""
    settings, a = LinkSettings(delay=0.05, jitter=0.3, loss=0.05), 50.0
    for period in (1e-3, 5e-4):
        hand = force_following(2, period, a)
        link = AdversarialLink(settings, PLANE, hand, network(settings), period).run(
            round(5.0 / period)
        )
        assert_bound(link, settings)
        assert link.device.uncertainty == pytest.approx(0.5 * a * period**2)
        assert link.overdraft <= link.force * 0.5 * a * period**2 + ROUNDING


def test_the_force_is_the_nearest_within_the_budget() -> None:
    """Feasible, and no other feasible force is nearer: the optimum's variational inequality."""
    rng = np.random.default_rng(4)
    metric = np.array([1.0, 1.0, 0.02])
    cut = 0
    for _ in range(400):
        effort, displacement, other = rng.normal(size=(3, 3))
        uncertainty, limit = rng.choice([0.0, 0.3, 1.0, 3.0]), rng.choice([0.0, 0.2, 1.0])

        def worst(
            force: Array, displacement: Array = displacement, uncertainty: float = uncertainty
        ) -> float:
            return float(force @ displacement) + uncertainty * np.sqrt(
                float(force @ (force / metric))
            )

        found = limit_work(effort, displacement, metric, uncertainty, limit)
        assert worst(found) <= limit + 1e-9
        if found is effort:
            continue
        cut += 1
        for scale in (0.01, 0.1, 1.0):
            rival = limit_work(found + scale * other, displacement, metric, uncertainty, limit)
            assert worst(rival) <= limit + 1e-9
            assert (effort - found) @ ((rival - found) / metric) <= 1e-7
    assert cut > 200


def test_without_uncertainty_the_limit_is_a_damping() -> None:
    """For a certain displacement the limit is a damping along it and nothing else."""
    rng = np.random.default_rng(6)
    metric = np.array([1.0, 0.02])
    for effort, displacement in rng.normal(size=(50, 2, 2)):
        found = limit_work(effort, displacement, metric, 0.0, 0.1)
        np.testing.assert_allclose(
            found, limit_power(effort, displacement, metric, 0.1), atol=1e-9
        )


def test_an_empty_budget_allows_only_certain_resistance() -> None:
    """A hand at rest gets no force; a moving one only a certainly opposing force."""
    push, metric = np.array([3.0, 1.0]), np.ones(2)
    np.testing.assert_array_equal(limit_work(push, np.zeros(2), metric, 0.1, 0.0), 0.0)
    found = limit_work(push, np.array([-1.0, 0.0]), metric, 0.1, 0.0)
    assert found[0] == pytest.approx(3.0, rel=0.1)
    assert found[1] == pytest.approx(1.0, rel=0.1)
    along = limit_work(push, np.array([1.0, 0.0]), metric, 0.1, 0.0)
    assert along @ np.array([1.0, 0.0]) + 0.1 * np.linalg.norm(along) <= 1e-12


def test_a_saturated_force_does_not_drive_the_hand() -> None:
    """A torque limit does not remove the resistance that balances the force."""

    def saturate(force: Array) -> Array:
        saturated = force.copy()
        saturated[1] = np.clip(saturated[1], -0.1, 0.1)
        return force if abs(force[1]) <= 0.1 else saturated

    device = ObservedDevice(LinkSettings(), np.ones(2), 1e-3, saturate)
    velocity = np.array([0.1, 1.0])
    device.receive(Packet(1, (np.array([5.0, -0.05]),), 0.0, 0.1))
    force = device.force(velocity)
    assert abs(force[1]) <= 0.1
    assert force @ velocity <= 1e-12
    device.observe(force, 1e-3 * velocity, Reference.at_rest(np.zeros(2)))
    assert device.port.delivered <= 1e-15
