# SPDX-License-Identifier: Apache-2.0
"""Rotations against scipy, and their differentials against differences and closed forms."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from noninteract_ros.subtasks import so3

RNG = np.random.default_rng(3)
AXES = RNG.normal(size=(60, 3))
AXES /= np.linalg.norm(AXES, axis=1, keepdims=True)
ANGLES = np.concatenate(
    [
        np.logspace(-12, 0, 20),
        np.linspace(0.9, 1.1, 15),
        np.linspace(1.2, 3.1, 20),
        np.pi - np.logspace(-12, -2, 5),
    ]
)
PHI = ANGLES[:, None] * AXES
RATES = RNG.normal(size=(60, 3))
STEP = 1e-6


def test_exp_is_the_matrix_exponential():
    """exp(phi) as a matrix is the exponential of [phi]."""
    for phi in PHI:
        np.testing.assert_allclose(so3.matrix(so3.exp(phi)), expm(so3.hat(phi)), atol=1e-14)


def test_quaternions_are_scipy_s():
    """Products, inverses, matrices and logarithms agree with scipy, whole arrays at once."""
    p, q = Rotation.from_rotvec(PHI), Rotation.from_rotvec(PHI[::-1])
    found = so3.product(p.as_quat(), q.as_quat())
    np.testing.assert_allclose(so3.matrix(found), (p * q).as_matrix(), atol=1e-14)
    np.testing.assert_allclose(so3.inverse(p.as_quat()), p.inv().as_quat(), atol=1e-15)
    np.testing.assert_allclose(so3.matrix(p.as_quat()), p.as_matrix(), atol=1e-14)
    np.testing.assert_allclose(so3.exp(PHI), p.as_quat(), atol=1e-15)


def test_log_undoes_exp_for_either_sign():
    """Up to half a turn the rotation vector comes back, for both signs of the quaternion."""
    for sign in (1.0, -1.0):
        back = so3.log(sign * so3.exp(PHI))
        np.testing.assert_allclose(back, PHI, rtol=1e-13, atol=1e-15)


def test_log_is_bounded_at_half_a_turn_and_zero_at_the_identity():
    """Beyond half a turn the shorter way is taken; nothing is ever NaN."""
    beyond = so3.log(so3.exp((np.pi + 0.1) * AXES))
    np.testing.assert_allclose(beyond, (0.1 - np.pi) * AXES, atol=1e-13)
    for identity in ([0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, -1.0]):
        np.testing.assert_array_equal(so3.log(np.array(identity)), np.zeros(3))
    tiny = np.array([1e-300, 0.0, 0.0, 1.0])
    np.testing.assert_allclose(so3.log(tiny), [2e-300, 0.0, 0.0], rtol=1e-12)


def test_quaternions_of_matrices_are_exact_at_every_angle():
    """Near half a turn no accuracy is lost; the scalar part is not negative."""
    whole = np.concatenate([PHI, [np.pi * np.eye(3)[i] for i in range(3)]])
    q = so3.quaternion(Rotation.from_rotvec(whole).as_matrix())
    expected = Rotation.from_rotvec(whole).as_quat(canonical=True)
    signs = np.where((q * expected).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
    np.testing.assert_allclose(signs * q, expected, atol=1e-15)
    assert (q[:, 3] >= 0.0).all()
    np.testing.assert_array_equal(so3.quaternion(np.eye(3)), [0.0, 0.0, 0.0, 1.0])


def series(phi, first):
    """Sum over k of [phi]^k / (k + 1)!, by brute force; phi is small enough for 40 terms."""
    total, power = np.zeros((3, 3)), np.eye(3) * first
    for k in range(1, 41):
        total += power
        power = power @ so3.hat(phi) / (k + 1)
    return total


def test_jacobian_is_its_power_series():
    """A is the sum of [phi]^k / (k + 1)! at every angle, and A^-1 is its inverse."""
    for phi in PHI:
        np.testing.assert_allclose(so3.jacobian(phi), series(phi, 1.0), atol=1e-14)
        np.testing.assert_allclose(
            so3.inverse_jacobian(phi) @ so3.jacobian(phi), np.eye(3), atol=1e-13
        )
    np.testing.assert_array_equal(so3.jacobian(PHI)[7], so3.jacobian(PHI[7]))


def test_jacobian_gives_the_angular_velocity():
    """A dphi/dt is the angular velocity of exp(phi), by differences."""
    omega = np.einsum("nij,nj->ni", so3.jacobian(PHI), RATES)
    ends = [so3.exp(PHI + h * RATES) for h in (-STEP, STEP)]
    turned = so3.log(so3.product(ends[1], so3.inverse(ends[0]))) / (2 * STEP)
    np.testing.assert_allclose(omega, turned, atol=1e-8)


@pytest.mark.parametrize(
    ("value", "rate"),
    [
        (so3.jacobian, so3.jacobian_rate),
        (so3.inverse_jacobian, so3.inverse_jacobian_rate),
    ],
)
def test_rates_are_derivatives(value, rate):
    """The rates of A and A^-1 by differences along a straight motion of phi."""
    slope = (value(PHI + STEP * RATES) - value(PHI - STEP * RATES)) / (2 * STEP)
    np.testing.assert_allclose(rate(PHI, RATES), slope, atol=2e-9)


def test_series_and_closed_forms_meet():
    """At the end of the series nothing jumps by more than rounding."""
    ends = [(1.0 + h) * AXES for h in (-1e-15, 1e-15)]
    for function in (so3.jacobian, so3.inverse_jacobian):
        np.testing.assert_allclose(function(ends[0]), function(ends[1]), atol=3e-15)
    for function in (so3.jacobian_rate, so3.inverse_jacobian_rate):
        np.testing.assert_allclose(function(ends[0], RATES), function(ends[1], RATES), atol=2e-14)


def test_rotation_vectors_are_their_own_images():
    """A phi = A' phi = phi: half the squared angle has phi as its gradient."""
    for A in (so3.jacobian(PHI), so3.inverse_jacobian(PHI)):
        np.testing.assert_allclose(np.einsum("nij,nj->ni", A, PHI), PHI, atol=1e-14)
        np.testing.assert_allclose(np.einsum("nji,nj->ni", A, PHI), PHI, atol=1e-14)
