# SPDX-License-Identifier: Apache-2.0
"""The hand impedance against an independent integration of its equation of motion."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from noninteract_ros.sources.human.hand import Hand
from noninteract_ros.sources.human.motion import swing

MASS, DAMPING, STIFFNESS, PERIOD = 0.8, 6.0, 150.0, 0.02
INTENDED = swing([0.4, -0.2], 5.0, [1.0, 2.0])
FORCES = np.random.default_rng(2).normal(0.0, 10.0, (40, 2))


def test_the_device_follows_its_equation_of_motion():
    """Sampled motion equals m ẍ = m ẍ_int - d (ẋ - ẋ_int) - k (x - x_int) + f, integrated."""
    hand = Hand(MASS, DAMPING, STIFFNESS, PERIOD, dim=2)
    start = INTENDED(0.0)
    state = np.concatenate([start.position, start.velocity])
    for step, force in enumerate(FORCES):

        def rate(t, state, force=force):
            intended, x, v = INTENDED(t), state[:2], state[2:]
            pull = force - DAMPING * (v - intended.velocity) - STIFFNESS * (x - intended.position)
            return np.concatenate([v, intended.acceleration + pull / MASS])

        end = (step + 1) * PERIOD
        solution = solve_ivp(rate, (step * PERIOD, end), state, rtol=1e-12, atol=1e-13)
        state = solution.y[:, -1]
        hand.advance(force, 1)
        device = hand.deflect(INTENDED(end), force)
        np.testing.assert_allclose(device.position, state[:2], atol=1e-10)
        np.testing.assert_allclose(device.velocity, state[2:], atol=1e-9)
        np.testing.assert_allclose(device.acceleration, rate(end, state)[2:], atol=1e-7)


def test_without_force_the_device_stays_on_the_intended_motion():
    """The device's motion equals the intended one to the bit."""
    hand = Hand(MASS, DAMPING, STIFFNESS, PERIOD, dim=2)
    hand.advance(np.zeros(2), 1000)
    device = hand.deflect(INTENDED(3.0), np.zeros(2))
    for name in ("position", "velocity", "acceleration"):
        np.testing.assert_array_equal(getattr(device, name), getattr(INTENDED(3.0), name))


def test_several_periods_at_once_equal_one_after_the_other():
    """A late sample is exact while the force is constant."""
    at_once, stepwise = (Hand(MASS, DAMPING, STIFFNESS, PERIOD, dim=2) for _ in range(2))
    for force in FORCES[:3]:
        at_once.advance(force, 7)
        for _ in range(7):
            stepwise.advance(force, 1)
    first, second = (hand.deflect(INTENDED(0.0), FORCES[2]) for hand in (at_once, stepwise))
    np.testing.assert_allclose(first.position, second.position, rtol=1e-13)
    np.testing.assert_allclose(first.velocity, second.velocity, rtol=1e-11)


def test_a_constant_force_deflects_by_force_over_stiffness():
    """A held force ends at f / k, at rest."""
    hand = Hand(MASS, DAMPING, STIFFNESS, PERIOD, dim=2)
    force = np.array([3.0, -1.5])
    hand.advance(force, 1000)
    device = hand.deflect(INTENDED(0.0), force)
    np.testing.assert_allclose(device.position - INTENDED(0.0).position, force / STIFFNESS)
    np.testing.assert_allclose(device.velocity, INTENDED(0.0).velocity, atol=1e-12)


@pytest.mark.parametrize(("damping", "stiffness"), [(0.0, 0.0), (3.0, 0.0), (0.0, 50.0)])
def test_a_hand_without_spring_or_damper_is_exact_too(damping, stiffness):
    """A singular generator needs no special case: the first acceleration is f / m."""
    hand = Hand(2.0, damping, stiffness, 1e-3, dim=1)
    force = np.array([4.0])
    hand.advance(force, 10)
    device = hand.deflect(swing([0.0], 1.0, [0.0])(0.0), force)
    assert device.position[0] == pytest.approx(0.5 * 2.0 * 0.01**2, rel=0.01)
