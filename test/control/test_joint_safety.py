# SPDX-License-Identifier: Apache-2.0
"""Limits of joints: bounded, passive, continuous; nothing at all inside them."""

import numpy as np
import pytest

from noninteract_ros.control.safety.joint_limits import JointSafety, SafetyReport
from noninteract_ros.control.safety.settings import SafetySettings
from noninteract_ros.team.models.planar_arm import PlanarArm
from noninteract_ros.team.team import Team

STEP = 1e-3
EFFORT = np.array([20.0, 8.0, 30.0, 10.0])
INSIDE = np.array([0.7, -0.4, 0.2, 1.0])
GRAVITY = np.array([5.0, -2.0, 12.0, 1.0])
SETTINGS = SafetySettings(position_margin=0.2, position_rate=50.0, velocity_rate=80.0)


def team(**keys) -> Team:
    """Two planar arms with limits of every kind, apart from what keys change."""
    limits = {
        "effort_limit": ((20.0, 8.0), (30.0, 10.0)),
        "lower_limit": ((-2.0, -2.0), (-1.0, -1.5)),
        "upper_limit": ((2.0, 1.5), (1.0, 2.5)),
        "velocity_limit": ((2.0, 3.0), (1.0, 4.0)),
    } | keys
    arms = [
        PlanarArm(
            (0.5, 0.4),
            (1.0 + k, 1.5),
            initial_position=tuple(INSIDE[2 * k : 2 * k + 2]),
            **{name: pair[k] for name, pair in limits.items() if pair},
        )
        for k in (0, 1)
    ]
    return Team([arm.build(f"arm_{k}") for k, arm in enumerate(arms)])


NONE = dict.fromkeys(("effort_limit", "lower_limit", "upper_limit", "velocity_limit"))


def protect(
    safety: JointSafety, torque: np.ndarray, q: np.ndarray = INSIDE, v: np.ndarray | None = None
) -> tuple[np.ndarray, SafetyReport]:
    return safety.protect(q, np.zeros(4) if v is None else v, torque, GRAVITY, STEP)


@pytest.mark.parametrize("keys", [{}, NONE])
def test_inside_all_limits_the_torque_is_the_law_s_to_the_bit(keys):
    """Whatever the law asks for within the limits passes as it is, and nothing is reported."""
    safety = JointSafety(team(**keys), SETTINGS)
    rng = np.random.default_rng(0)
    lower, upper = np.array([-1.8, -1.8, -0.8, -1.3]), np.array([1.8, 1.3, 0.8, 2.3])
    for _ in range(200):
        torque = rng.uniform(-EFFORT, EFFORT)
        speed = rng.uniform(-1.0, 1.0, 4) * [2.0, 3.0, 1.0, 4.0]
        found, report = protect(safety, torque, rng.uniform(lower, upper), speed)
        np.testing.assert_array_equal(found, torque)
        assert report == SafetyReport()
        assert not report.acted


def test_without_limits_nothing_is_bounded():
    """A team without limits gets any finite torque, anywhere and at any speed."""
    safety = JointSafety(team(**NONE), SETTINGS)
    torque = np.array([1e6, -1e9, 3.0, 1e300])
    found, report = protect(safety, torque, 100.0 * INSIDE, np.full(4, 1e3))
    np.testing.assert_array_equal(found, torque)
    assert not report.acted


def test_too_much_torque_is_shrunk_towards_gravity_as_a_whole():
    """What exceeds gravity keeps its direction over the whole team, as long as limits allow."""
    safety = JointSafety(team(), SETTINGS)
    rng = np.random.default_rng(1)
    shares = []
    for _ in range(500):
        torque = GRAVITY + rng.uniform(-1.0, 1.0, 4) * [60.0, 20.0, 60.0, 20.0]
        found, report = protect(safety, torque)
        assert (np.abs(found) <= EFFORT).all()
        beyond = found - GRAVITY
        np.testing.assert_allclose(beyond, report.effort_share * (torque - GRAVITY), atol=1e-12)
        if (np.abs(torque) > EFFORT).any():
            assert report.effort_share < 1.0
            assert np.isclose(np.abs(found), EFFORT).any()  # No smaller than needed.
        shares.append(report.effort_share)
    assert min(shares) < 0.5 < max(shares)


def test_gravity_takes_room_on_its_own_side_only():
    """A joint that lifts has less room upwards and more downwards."""
    safety = JointSafety(team(), SETTINGS)
    torque = np.array([0.0, 0.0, -29.0, 0.0])  # 41 below gravity, yet within the limit.
    np.testing.assert_array_equal(protect(safety, torque)[0], torque)


def test_gravity_beyond_the_limits_is_held_as_far_as_possible():
    """A team that is too weak to hold itself gives what it can, in the right direction."""
    safety = JointSafety(team(), SETTINGS)
    gravity = np.array([25.0, -2.0, -60.0, 1.0])
    found, report = safety.protect(INSIDE, np.zeros(4), 2.0 * gravity, gravity, STEP)
    assert (np.abs(found) <= EFFORT).all()
    np.testing.assert_allclose(found[[0, 2]], [20.0, -30.0])
    assert report.effort_share < 1.0


def test_saturation_is_continuous():
    """Torques that differ little are bounded to torques that differ little."""
    safety = JointSafety(team(), SETTINGS)
    direction = np.array([30.0, -20.0, 50.0, 12.0])
    path = [protect(safety, GRAVITY + s * direction)[0] for s in np.arange(0.0, 4.0, 1e-3)]
    assert np.abs(np.diff(path, axis=0)).max() <= 1e-3 * 50.0 * (1.0 + 1e-9)


def inertia_of(joint: int, given: Team) -> float:
    """What a joint feels of the team's inertia when all others are free."""
    M = given.state(given.q0, np.zeros(4)).M
    return float(1.0 / np.linalg.solve(M, np.eye(4)[joint])[joint])


@pytest.mark.parametrize(("joint", "side"), [(0, 1), (0, -1), (1, 1), (2, -1), (3, 1)])
def test_a_joint_near_its_limit_is_repelled_by_a_spring(joint, side):
    """From the margin on, k = w^2 I pushes it back, and no other joint."""
    given = team()
    safety = JointSafety(given, SETTINGS)
    limit = given.position_limits[(side + 1) // 2][joint]
    for depth in (-1e-6, 1e-6, 0.1, 0.2, 0.4):
        q = INSIDE.copy()
        q[joint] = limit - side * (0.2 - depth)
        found, report = protect(safety, np.zeros(4), q)
        expected = np.zeros(4)
        expected[joint] = -side * max(depth, 0.0) * 2500.0 * inertia_of(joint, given)
        np.testing.assert_allclose(found, np.clip(expected, -EFFORT, EFFORT), atol=1e-12)
        assert report.repelled == ((joint,) if depth > 0.0 else ())
        assert report.clipped == (abs(expected[joint]) > EFFORT[joint])


def test_repulsion_and_brake_take_energy_round_any_loop():
    """Over closed motions through limits and speeds their work is negative: they are passive."""
    given = team(effort_limit=None)
    safety = JointSafety(given, SETTINGS)
    rng = np.random.default_rng(2)
    for _ in range(5):
        amplitude, phase = rng.uniform(0.5, 3.0, (2, 4))
        t = np.arange(0.0, 2.0 * np.pi, 1e-3)[:, None]
        q, v = amplitude * np.sin(t + phase), amplitude * np.cos(t + phase)
        torques = [protect(safety, np.zeros(4), *state)[0] for state in zip(q, v, strict=True)]
        powers = np.array(torques) * v
        assert (powers.sum(axis=0) * 1e-3 < 1e-3).all()
        assert powers.sum() < 0.0


def test_a_repelled_joint_is_damped_both_ways():
    """At its limit a joint loses speed by 2 w I, inwards and outwards; at the margin nothing."""
    given = team(effort_limit=None)
    safety = JointSafety(given, SETTINGS)
    q = INSIDE.copy()
    for depth, share in ((0.0, 0.0), (0.1, 0.5), (0.2, 1.0), (0.3, 1.0)):
        q[0] = 2.0 - 0.2 + depth
        forces = [protect(safety, np.zeros(4), q, s * np.eye(4)[0])[0][0] for s in (1.0, -1.0)]
        damping = -0.5 * (forces[0] - forces[1])
        assert damping == pytest.approx(share * 2.0 * 50.0 * inertia_of(0, given), abs=1e-9)


def test_margins_of_narrow_joints_do_not_overlap():
    """A joint with less room than two margins is free in its middle; a fixed one is finite."""
    narrow = team(lower_limit=((-2.0, -0.5), (-1.0, 1.0)), upper_limit=((2.0, -0.3), (1.0, 1.0)))
    safety = JointSafety(narrow, SETTINGS)
    q = np.array([0.7, -0.4, 0.2, 1.0])
    found, report = protect(safety, np.ones(4), q, np.array([0.1, 0.1, 0.1, 0.1]))
    np.testing.assert_array_equal(found, np.ones(4))
    assert not report.acted
    q[0] = 1.95  # Another joint is repelled while the fixed one is where it has to be.
    found, report = protect(safety, np.zeros(4), q)
    assert np.isfinite(found).all()
    assert report.repelled == (0,)
    q[0] = 0.7
    for off in (-1e-3, 1e-3):
        q[3] = 1.0 + off
        found, report = protect(safety, np.zeros(4), q)
        assert np.isfinite(found).all()
        assert report.repelled == (3,)
        assert np.sign(found[3]) == -np.sign(off)


def test_a_joint_that_is_too_fast_is_braked():
    """What is beyond the limit of speed decays at the given rate; others go on."""
    given = team(effort_limit=None)
    safety = JointSafety(given, SETTINGS)
    for speed, excess in ((2.0, 0.0), (2.5, 0.5), (-2.0, 0.0), (-3.0, -1.0)):
        found, report = protect(safety, np.zeros(4), INSIDE, np.array([speed, 0.0, 0.0, 0.0]))
        expected = np.array([-80.0 * inertia_of(0, given) * excess, 0.0, 0.0, 0.0])
        np.testing.assert_allclose(found, expected, atol=1e-12)
        assert report.too_fast == ((0,) if excess else ())


def test_repulsion_has_all_the_effort_that_its_joint_has():
    """A law that pushes into a limit with all its effort leaves the repulsion room."""
    safety = JointSafety(team(), SETTINGS)
    q = INSIDE.copy()
    q[0] = 2.0  # Where the spring alone is beyond the effort limit.
    found, report = protect(safety, np.array([1e6, 0.0, 0.0, 0.0]), q)
    assert found[0] < -10.0
    assert report.effort_share < 1e-4


def test_the_torque_changes_no_faster_than_allowed():
    """Each joint's change is bounded, the direction of the change kept; it arrives in the end."""
    safety = JointSafety(team(), SafetySettings(torque_rate=500.0))
    start, wanted = np.zeros(4), np.array([15.0, -5.0, 25.0, 3.0])
    found, report = protect(safety, start)
    np.testing.assert_array_equal(found, start)
    ticks = 0
    while report.rate_share < 1.0 or ticks == 0:
        before = found
        found, report = protect(safety, wanted)
        change = found - before
        assert np.abs(change).max() <= 500.0 * STEP * (1.0 + 1e-12)
        np.testing.assert_allclose(change * wanted[2], wanted * change[2], atol=1e-12)
        ticks += 1
    assert ticks == 50  # 25 N m by 0.5 N m a tick.
    np.testing.assert_array_equal(found, wanted)


def test_a_rate_limited_torque_stays_within_effort_limits():
    """Between two torques within the limits there is none beyond them, whatever gravity does."""
    safety = JointSafety(team(), SafetySettings(torque_rate=2000.0))
    rng = np.random.default_rng(3)
    for _ in range(300):
        gravity, torque = rng.uniform(-40.0, 40.0, (2, 4))
        found, _ = safety.protect(INSIDE, np.zeros(4), torque, gravity, STEP)
        assert (np.abs(found) <= EFFORT * (1.0 + 1e-12)).all()


def test_a_longer_gap_allows_a_larger_change():
    """The limit is one of change per time; after a reset the past does not count."""
    safety = JointSafety(team(), SafetySettings(torque_rate=500.0))
    protect(safety, np.zeros(4))
    torque = np.array([15.0, 0.0, 0.0, 0.0])
    found, _ = safety.protect(INSIDE, np.zeros(4), torque, GRAVITY, 0.01)
    assert found[0] == pytest.approx(5.0)
    safety.reset()
    np.testing.assert_array_equal(protect(safety, torque)[0], torque)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("keys", [{}, NONE])
def test_what_is_no_number_is_replaced_by_gravity_and_brakes(bad, keys):
    """A law that fails leaves a team that holds itself and comes to rest; it is reported."""
    given = team(**keys)
    safety = JointSafety(given, SafetySettings(torque_rate=100.0))
    v = np.array([0.2, -0.1, 0.3, 0.1])
    torque = np.array([1.0, bad, 2.0, 3.0])
    found, report = protect(safety, torque, INSIDE, v)
    np.testing.assert_allclose(found, GRAVITY - given.brake_damping * v)
    assert not report.finite
    assert report.acted
    # The next good torque is reached at the rate that is allowed.
    found_next, report = protect(safety, np.zeros(4), INSIDE, v)
    assert np.isfinite(found_next).all()
    assert np.abs(found_next - found).max() <= 0.1 * (1.0 + 1e-9)
    assert report.finite
