# SPDX-License-Identifier: Apache-2.0
"""Values with rotations: differences, sums and motions composed with exact derivatives."""

import numpy as np
import pytest

from noninteract_ros.errors import InputError
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.layout import Layout

MIXED = Layout((3, 0, 2, 1), (True, True, False, True))
STEP = 1e-4


def random_value(layout: Layout, rng) -> np.ndarray:
    x = rng.normal(size=layout.size)
    x[layout.quaternions] = so3.normalized(x[layout.quaternions])
    return x


def test_a_rotation_is_four_numbers_of_a_value_and_three_of_a_velocity():
    """Indices run element by element, scalars first."""
    assert (MIXED.size, MIXED.dim) == (3 + 4 + 4 + 2 + 1 + 4, 3 + 3 + 3 + 2 + 1 + 3)
    assert MIXED.values.tolist() == [0, 1, 2, 11, 12, 13]
    assert MIXED.rates.tolist() == [0, 1, 2, 9, 10, 11]
    assert MIXED.quaternions.tolist() == [[3, 4, 5, 6], [7, 8, 9, 10], [14, 15, 16, 17]]
    assert MIXED.angular.tolist() == [[3, 4, 5], [6, 7, 8], [12, 13, 14]]
    joined = Layout.joined([Layout((3, 0), (True, True)), Layout((2, 1), (False, True))])
    np.testing.assert_array_equal(joined.quaternions, MIXED.quaternions)
    np.testing.assert_array_equal(joined.rates, MIXED.rates)


def test_scalars_have_plain_arithmetic():
    """Without rotations every operation is the elementary one, to the bit."""
    layout, rng = Layout.scalars(5), np.random.default_rng(0)
    a, b = ([rng.normal(size=5) for _ in range(3)] for _ in range(2))
    assert not layout.rotates
    np.testing.assert_array_equal(layout.difference(a[0], b[0]), a[0] - b[0])
    np.testing.assert_array_equal(layout.relative_motion(a, b), np.subtract(a, b))
    np.testing.assert_array_equal(layout.compose_motion(a, b), np.add(a, b))
    x, v, acceleration = layout.extrapolate(a, 0.3)
    np.testing.assert_array_equal(x, a[0] + 0.3 * a[1] + (0.5 * 0.3 * 0.3) * a[2])
    np.testing.assert_array_equal(v, a[1] + 0.3 * a[2])
    assert acceleration is a[2]


def test_sum_undoes_difference():
    """x_d + (x - x_d) is x, as rotations, for whole arrays of values."""
    rng = np.random.default_rng(1)
    x, x_d = ([random_value(MIXED, rng) for _ in range(20)] for _ in range(2))
    x, x_d = np.array(x), np.array(x_d)
    back = MIXED.sum(x_d, MIXED.difference(x, x_d))
    np.testing.assert_allclose(MIXED.difference(back, x), np.zeros((20, MIXED.dim)), atol=1e-13)
    np.testing.assert_array_equal(MIXED.difference(x, x_d)[3], MIXED.difference(x[3], x_d[3]))


def test_the_sign_of_a_quaternion_means_nothing():
    """Both quaternions of a rotation have the same differences."""
    rng = np.random.default_rng(2)
    x, x_d = random_value(MIXED, rng), random_value(MIXED, rng)
    other = x.copy()
    other[MIXED.quaternions[1]] *= -1.0
    np.testing.assert_array_equal(MIXED.difference(other, x_d), MIXED.difference(x, x_d))
    np.testing.assert_allclose(MIXED.difference(x_d, other), MIXED.difference(x_d, x), rtol=1e-15)


def test_the_largest_difference_is_half_a_turn():
    """Opposite rotations differ by pi; beyond, the opposite direction is shorter."""
    layout, axis = Layout((0,), (True,)), np.array([0.6, 0.0, 0.8])
    for over in (-1e-9, 1e-9, 0.3):
        e = layout.difference(so3.exp((np.pi + over) * axis), layout.identity)
        expected = (np.pi + over - (2 * np.pi if over > 0 else 0.0)) * axis
        np.testing.assert_allclose(e, expected, atol=1e-13)


def path(layout: Layout, seed: int):
    """A smooth motion with rotations, and its time derivatives by the layout itself."""
    rng = np.random.default_rng(seed)
    start, amplitude = random_value(layout, rng), rng.normal(size=layout.dim)
    still = np.zeros(layout.dim)

    def at(t: float):
        gap = (amplitude * np.sin(t), amplitude * np.cos(t), -amplitude * np.sin(t))
        bent = tuple(np.roll(part, 1) * f for part, f in zip(gap, (1, 1, 1), strict=True))
        return layout.compose_motion(layout.compose_motion((start, still, still), gap), bent)

    return at


def slopes(layout: Layout, at, t: float):
    before, after = at(t - STEP), at(t + STEP)
    velocity = layout.difference(after[0], before[0]) / (2 * STEP)
    return velocity, (after[1] - before[1]) / (2 * STEP)


def test_composed_motions_have_exact_derivatives():
    """Velocity and acceleration of a motion moved by a gap are those of the result."""
    for seed in range(5):
        at = path(MIXED, seed)
        for t in (0.0, 0.7, 2.0):
            _, velocity, acceleration = at(t)
            expected = slopes(MIXED, at, t)
            np.testing.assert_allclose(velocity, expected[0], atol=1e-7)
            np.testing.assert_allclose(acceleration, expected[1], atol=1e-6)


def test_relative_motions_have_exact_derivatives_and_compose_back():
    """The difference of two motions has the stated rates, and composes back to the motion."""
    for seed in range(5):
        one, other = path(MIXED, seed), path(MIXED, seed + 50)
        gap = MIXED.relative_motion(one(0.4), other(0.4))
        for found, expected in zip(
            MIXED.compose_motion(other(0.4), gap)[1:], one(0.4)[1:], strict=True
        ):
            np.testing.assert_allclose(found, expected, atol=1e-11)
        before, after = (MIXED.relative_motion(one(t), other(t)) for t in (0.4 - STEP, 0.4 + STEP))
        np.testing.assert_allclose(gap[1], (after[0] - before[0]) / (2 * STEP), atol=1e-5)
        np.testing.assert_allclose(gap[2], (after[1] - before[1]) / (2 * STEP), atol=1e-4)


def test_extrapolation_has_exact_derivatives_and_the_right_start():
    """At dt = 0 it is the motion itself; at dt its rates are those of its path."""
    motion = path(MIXED, 7)(0.3)
    for found, expected in zip(MIXED.extrapolate(motion, 0.0)[1:], motion[1:], strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-14, atol=1e-15)
    _, velocity, acceleration = MIXED.extrapolate(motion, 0.2)
    expected = slopes(MIXED, lambda dt: MIXED.extrapolate(motion, dt), 0.2)
    np.testing.assert_allclose(velocity, expected[0], atol=1e-7)
    np.testing.assert_allclose(acceleration, expected[1], atol=1e-6)


def test_a_steady_turn_goes_on_for_good():
    """Constant angular velocity stays constant, over any time."""
    layout, omega = Layout((0,), (True,)), np.array([0.3, -2.0, 1.0])
    x, velocity, acceleration = layout.extrapolate((layout.identity, omega, np.zeros(3)), 100.0)
    np.testing.assert_allclose(velocity, omega, rtol=1e-12)
    np.testing.assert_allclose(acceleration, np.zeros(3), atol=1e-12)
    assert np.linalg.norm(x) == pytest.approx(1.0, abs=1e-15)


def test_quaternions_are_checked_and_normalised():
    """Small errors are corrected, larger ones rejected; scalars pass unchanged."""
    layout = Layout((1,), (True,))
    found = layout.checked(np.array([7.0, 0.0, 0.0, 0.0, 1.0005]))
    np.testing.assert_array_equal(found, [7.0, 0.0, 0.0, 0.0, 1.0])
    with pytest.raises(InputError, match="length 0, should be 1"):
        layout.checked(np.zeros((2, 5)))


def test_unit_quaternions_pass_a_check_to_the_bit():
    """Otherwise a message would not carry the sent value."""
    layout = Layout((0,), (True,))
    for phi in np.random.default_rng(2).normal(size=(200, 3)):
        q = layout.sum(layout.identity, phi)
        np.testing.assert_array_equal(layout.checked(q), q)
