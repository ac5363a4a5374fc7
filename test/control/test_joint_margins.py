# SPDX-License-Identifier: Apache-2.0
"""Margins of joints: passive, continuous; nothing at all inside the limits."""

import numpy as np
import pytest

from noninteract_ros.control.safety.joint_limits import DEEPENING, Guard, JointMargins
from noninteract_ros.control.safety.settings import SafetySettings
from noninteract_ros.team.models.planar_arm import PlanarArm
from noninteract_ros.team.team import Team

STEP = 1e-3
INSIDE = np.array([0.7, -0.4, 0.2, 1.0])
NO_ONSET = np.zeros(4)
SETTINGS = SafetySettings(position_margin=0.2, position_rate=50.0, velocity_rate=80.0)


def team(**keys) -> Team:
    """Two planar arms with limits of every kind, apart from what keys change."""
    limits = {
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


def guard(margins: JointMargins, q: np.ndarray = INSIDE, v: np.ndarray | None = None) -> Guard:
    return margins.at(margins.depth(q), np.zeros(4) if v is None else v, NO_ONSET)


def torque(margins: JointMargins, q: np.ndarray = INSIDE, v: np.ndarray | None = None):
    found = guard(margins, q, v).torque
    return np.zeros(4) if found is None else found


def test_inside_all_limits_there_is_no_torque():
    """Neither repulsion nor brake, nor an energy of theirs."""
    margins = JointMargins(team(), SETTINGS)
    rng = np.random.default_rng(0)
    lower, upper = np.array([-1.8, -1.8, -0.8, -1.3]), np.array([1.8, 1.3, 0.8, 2.3])
    for _ in range(200):
        speed = rng.uniform(-1.0, 1.0, 4) * [2.0, 3.0, 1.0, 4.0]
        found = guard(margins, rng.uniform(lower, upper), speed)
        assert found.torque is None
        assert (found.potential, found.repelled, found.too_fast) == (0.0, (), ())


def inertia_of(joint: int, given: Team) -> float:
    """Return the inertia at a joint when all others are free."""
    M = given.state(given.q0, np.zeros(4)).M
    return float(1.0 / np.linalg.solve(M, np.eye(4)[joint])[joint])


@pytest.mark.parametrize(("joint", "side"), [(0, 1), (0, -1), (1, 1), (2, -1), (3, 1)])
def test_a_joint_near_its_limit_is_repelled_by_a_spring(joint, side):
    """From the margin on, k = w^2 I pushes it back, and no other joint."""
    given = team()
    margins = JointMargins(given, SETTINGS)
    limit = given.position_limits[(side + 1) // 2][joint]
    for depth in (-1e-6, 1e-6, 0.1, 0.2, 0.4):
        q = INSIDE.copy()
        q[joint] = limit - side * (0.2 - depth)
        found = guard(margins, q)
        expected = np.zeros(4)
        stiffness = 2500.0 * inertia_of(joint, given)
        expected[joint] = -side * max(depth, 0.0) * stiffness
        np.testing.assert_allclose(torque(margins, q), expected, atol=1e-12)
        assert found.repelled == ((joint,) if depth > 0.0 else ())
        assert found.potential == pytest.approx(0.5 * stiffness * max(depth, 0.0) ** 2)


def test_repulsion_and_brake_take_energy_round_any_loop():
    """Over closed motions through limits and speeds their work is negative: they are passive."""
    given = team()
    margins = JointMargins(given, SETTINGS)
    rng = np.random.default_rng(2)
    for _ in range(5):
        amplitude, phase = rng.uniform(0.5, 3.0, (2, 4))
        t = np.arange(0.0, 2.0 * np.pi, 1e-3)[:, None]
        q, v = amplitude * np.sin(t + phase), amplitude * np.cos(t + phase)
        torques = [torque(margins, *state) for state in zip(q, v, strict=True)]
        powers = np.array(torques) * v
        assert (powers.sum(axis=0) * 1e-3 < 1e-3).all()
        assert powers.sum() < 0.0


def test_a_repelled_joint_is_damped_both_ways():
    """At its limit a joint loses speed by 2 w I, inwards and outwards; at the margin nothing."""
    given = team()
    margins = JointMargins(given, SETTINGS)
    q = INSIDE.copy()
    for depth, share in ((0.0, 0.0), (0.1, 0.5), (0.2, 1.0), (0.3, 1.0)):
        q[0] = 2.0 - 0.2 + depth
        forces = [torque(margins, q, s * np.eye(4)[0])[0] for s in (1.0, -1.0)]
        damping = -0.5 * (forces[0] - forces[1])
        assert damping == pytest.approx(share * 2.0 * 50.0 * inertia_of(0, given), abs=1e-9)


def test_margins_of_narrow_joints_do_not_overlap():
    """A joint with less room than two margins is free in its middle, however little that is."""
    lower, upper = ((-2.0, -0.5), (-1.0, 1.0 - 1e-6)), ((2.0, -0.3), (1.0, 1.0 + 1e-6))
    margins = JointMargins(team(lower_limit=lower, upper_limit=upper), SETTINGS)
    q = np.array([0.7, -0.4, 0.2, 1.0])
    assert guard(margins, q, np.full(4, 0.1)).torque is None
    q[0] = 1.95
    assert np.isfinite(torque(margins, q)).all()
    assert guard(margins, q).repelled == (0,)
    q[0] = 0.7
    for off in (-1e-3, 1e-3):
        q[3] = 1.0 + off
        found = torque(margins, q)
        assert np.isfinite(found).all()
        assert guard(margins, q).repelled == (3,)
        assert np.sign(found[3]) == -np.sign(off)


def test_a_joint_that_is_too_fast_is_braked():
    """Excess speed beyond the limit decays at the given rate; other joints go on."""
    given = team()
    margins = JointMargins(given, SETTINGS)
    for speed, excess in ((2.0, 0.0), (2.5, 0.5), (-2.0, 0.0), (-3.0, -1.0)):
        v = np.array([speed, 0.0, 0.0, 0.0])
        expected = np.array([-80.0 * inertia_of(0, given) * excess, 0.0, 0.0, 0.0])
        np.testing.assert_allclose(torque(margins, v=v), expected, atol=1e-12)
        assert guard(margins, v=v).too_fast == ((0,) if excess else ())


def test_a_joint_found_inside_its_margin_is_not_thrown_out():
    """Its potential begins at the depth it is found at, and reaches further out in time."""
    margins = JointMargins(team(), SETTINGS)
    q = INSIDE.copy()
    q[0] = 2.0  # On its limit.
    depth = margins.depth(q)
    onset = np.abs(depth)
    assert onset[0] == pytest.approx(0.2)
    found = margins.at(depth, np.zeros(4), onset)
    assert found.potential == 0.0
    np.testing.assert_array_equal(found.torque, np.zeros(4))
    deeper = margins.at(margins.depth(q + 0.05 * np.eye(4)[0]), np.zeros(4), onset)
    assert deeper.torque[0] < 0.0
    for _ in range(round(DEEPENING / STEP) + 1):
        onset = margins.deeper(onset, STEP)
    np.testing.assert_array_equal(onset, np.zeros(4))
    assert margins.at(depth, np.zeros(4), onset).potential > 0.0
