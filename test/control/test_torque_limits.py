# SPDX-License-Identifier: Apache-2.0
"""Limits of torques and of their rates: which part of the law gives way, and what is booked."""

import numpy as np
import pytest
from test_singularity import SingularityLoop, team

from noninteract_ros.control.safety.settings import SafetySettings
from noninteract_ros.control.safety.torque_limiter import groups_of
from noninteract_ros.control.safety.torque_limits import fitting, slewed

LIMITS = np.array([20.0, 8.0, 30.0, 10.0])
BASE = np.array([5.0, -2.0, 12.0, 1.0])


def scaled(base: np.ndarray, groups: list[np.ndarray], shares: tuple[float, ...]) -> np.ndarray:
    return base + sum(s * group for s, group in zip(shares, groups, strict=True))


def random_groups(rng: np.random.Generator, size: float = 20.0) -> list[np.ndarray]:
    return [rng.normal(0.0, size, 4) for _ in range(4)]


def test_what_fits_is_whole():
    """As long as the sum is within the limits nothing gives way."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        groups = random_groups(rng, 2.0)
        total = scaled(BASE, groups, (1.0,) * 4)
        if (np.abs(total) <= LIMITS).all():
            assert fitting(BASE, groups, LIMITS) == (1.0,) * 4


def test_every_sum_fits_in_the_end():
    """For any request the base stays and the sum keeps within the limits."""
    rng = np.random.default_rng(1)
    for _ in range(500):
        groups = random_groups(rng)
        shares = fitting(BASE, groups, LIMITS)
        assert all(0.0 <= share <= 1.0 for share in shares)
        assert (np.abs(scaled(BASE, groups, shares)) <= LIMITS * (1.0 + 1e-8)).all()


def test_the_decoupling_gives_way_first_and_the_dampers_last():
    """A group gives way little where those before it can make the sum fit."""
    along = np.array([30.0, 0.0, 0.0, 0.0])
    for room in np.arange(0.0, 120.0, 7.0):
        limits = LIMITS + room * np.eye(4)[0]
        shares = fitting(BASE, [along] * 4, limits)
        assert (np.diff(shares) > -1e-9).all()
        left = min(4.0, (limits[0] - BASE[0]) / 30.0)
        assert sum(shares) == pytest.approx(left)
        # As many groups as there is room for are nearly whole, the cheaper ones nearly gone.
        assert sum(shares[: max(0, 4 - int(left + 1.0))]) < 0.2


def test_shares_are_continuous():
    """Torques that differ little are bounded to torques that differ little."""
    rng = np.random.default_rng(2)
    for _ in range(10):
        start, end = random_groups(rng), random_groups(rng)
        for place in rng.uniform(0.0, 1.0, 40):
            path = []
            for s in place + np.array([0.0, 1e-7]):
                groups = [a + s * (b - a) for a, b in zip(start, end, strict=True)]
                path.append(scaled(BASE, groups, fitting(BASE, groups, LIMITS)))
            assert np.abs(path[1] - path[0]).max() < 1e-3


def test_a_joint_without_a_limit_does_not_count():
    """It takes whatever is asked for."""
    limits = np.array([np.inf, 8.0, 30.0, 10.0])
    groups = [np.array([1e6, 0.0, 0.0, 0.0])] * 4
    assert fitting(BASE, groups, limits) == (1.0,) * 4


def test_each_joint_changes_no_faster_than_allowed():
    """A joint that is slow enough is not slowed down by another."""
    last, torque = np.array([0.0, 1.0, 0.0, -1.0]), np.array([3.0, 1.2, -0.1, -1.0])
    found, share = slewed(torque, last, 0.5)
    np.testing.assert_allclose(found, [0.5, 1.2, -0.1, -1.0])
    assert share == pytest.approx(0.5 / 3.0)
    again, whole = slewed(found, found, 0.5)
    assert again is found
    assert whole == 1.0


def strained(limit: tuple[float, float], law: str = "energy_gated", **keys) -> SingularityLoop:
    """Arms that are held 0.3 m from where their springs want them, then let go of."""
    loop = SingularityLoop(team(effort_limit=limit, plane="xz", **keys), law)
    loop.tick()
    loop.simulation.push("arm_0", np.array([250.0, 0.0, 100.0, 0.0, 0.0, 0.0]), False, 0.4)
    return loop


@pytest.mark.parametrize("law", ["energy_gated", "natural"])
def test_what_limits_cut_is_booked(law):
    """At its limits the account follows the robots' true energy, and nothing is left over."""
    loop = strained((25.0, 12.0), law)
    simulation, given = loop.simulation, loop.controller.team
    start = given.mechanical_energy(simulation.q, simulation.v)
    works = simulation.energy().controls
    cut, first = 0, loop.tick().account
    for _ in range(900):
        tick = loop.tick()
        cut += tick.safety.effort_share < 1.0
        assert (np.abs(tick.torque) <= [25.0, 12.0, 25.0, 12.0]).all()
    assert cut > 100
    found = loop.answer().account
    stored = given.mechanical_energy(simulation.q, simulation.v) - start
    pushed = stored - (simulation.energy().controls - works)
    assert found.received - first.received == pytest.approx(pushed, abs=1e-4)
    assert abs(found.imbalance) <= found.bound


def test_parts_of_a_command_add_up():
    """Gravity and the groups that limits scale are the torque that is asked for."""
    loop = strained((1e3, 1e3))
    for _ in range(100):
        tick = loop.tick()
    core = loop.controller
    command = core.gate._commands._commands[-1]
    groups = groups_of(command, core.gate._last, core.gate.tank)
    total = tick.dynamics.g + sum(groups.scaled(type(tick.safety.shares)()))
    np.testing.assert_allclose(total, tick.torque, atol=1e-9)


def test_a_shove_at_a_rate_limit_comes_to_rest():
    """Gains that the limit does not fit at a speed wait until it does."""
    loop = SingularityLoop(team(), "energy_gated", safety=SafetySettings(torque_rate=300.0))
    loop.tick()
    loop.simulation.push("arm_0", np.array([40.0, 30.0, 0.0, 0.0, 0.0, 0.0]), False, 0.1)
    torques, reduced = [], 0
    for _ in range(3000):
        tick = loop.tick()
        torques.append(tick.torque)
        reduced += tick.safety.rate_fit < 1.0
    assert reduced > 20
    assert np.abs(np.diff(torques, axis=0)).max() <= 0.3 * (1.0 + 1e-9)
    assert np.abs(loop.simulation.v).max() < 1e-2
    assert np.abs(tick.error.e).max() < 1e-2
    assert tick.safety.rate_fit == 1.0


def test_a_longer_gap_allows_a_larger_change():
    """The limit is one of change per time."""
    loop = SingularityLoop(team(plane="xz"), safety=SafetySettings(torque_rate=200.0))
    core, q = loop.controller, loop.controller.team.q0
    first = core.step(0.0, q, np.zeros(4)).torque
    second = core.step(0.01, q, np.full(4, 5.0)).torque
    assert np.abs(second - first).max() == pytest.approx(2.0)
