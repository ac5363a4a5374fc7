# SPDX-License-Identifier: Apache-2.0
"""Intended hand motions: exact derivatives, continuity, and the equation of each motion."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import BPoly

from noninteract_ros.sources.human import motion as motions
from noninteract_ros.sources.human.replay import replay
from noninteract_ros.sources.minimum_jerk import RestToRest
from noninteract_ros.subtasks.layout import Layout

TIMES = [0.0, 1.0, 1.5, 4.0]
POINTS = [[0.0, 0.0], [1.0, -1.0], [1.0, 0.5], [-2.0, 3.0]]
RECORDED = np.linspace(5.0, 9.0, 41)
SWING = motions.swing([2.0, 0.0], 0.79, [0.0, 1.0])

MOTIONS = {
    "swing": SWING,
    "circle": motions.circle([1.0, 2.0, 3.0], 0.5, -1.7, 0.9),
    "circle at once": motions.circle([1.0, 2.0], 0.5, 1.7, 0.0),
    "waypoints": motions.waypoints(TIMES, POINTS),
    "replay": replay(RECORDED, np.stack([np.sin(RECORDED), np.cos(2 * RECORDED)], axis=1)),
    "still": motions.still([3.0]),
    "tremor": motions.with_tremor(SWING, 0.01, seed=3, layout=Layout.scalars(2)),
    "delayed": motions.delayed(SWING, 0.7),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_derivatives_match_finite_differences(name):
    """Velocity and acceleration are the derivatives of position and velocity."""
    motion, h = MOTIONS[name], 1e-5
    for t in np.random.default_rng(1).uniform(0.01, 3.95, 40):
        before, now, after = motion(t - h), motion(t), motion(t + h)
        velocity = (after.position - before.position) / (2 * h)
        acceleration = (after.velocity - before.velocity) / (2 * h)
        np.testing.assert_allclose(now.velocity, velocity, atol=2e-7)
        np.testing.assert_allclose(now.acceleration, acceleration, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "instants"),
    [("waypoints", TIMES), ("circle", [0.0, 0.9]), ("replay", [0.1, 1.0, 3.9])],
)
def test_joints_are_twice_continuously_differentiable(name, instants):
    """At the joint of two pieces, position, velocity and acceleration do not jump."""
    for t in instants:
        before, after = MOTIONS[name](t - 1e-9), MOTIONS[name](t + 1e-9)
        np.testing.assert_allclose(before.position, after.position, atol=1e-7)
        np.testing.assert_allclose(before.velocity, after.velocity, atol=1e-6)
        np.testing.assert_allclose(before.acceleration, after.acceleration, atol=1e-5)


def test_the_papers_operator():
    """The swing is (2 sin 0.79 t, 1) and an undamped oscillation about its offset."""
    for t in (4.0, 7.3, 20.0):
        now = SWING(t)
        np.testing.assert_allclose(now.position, [2 * np.sin(0.79 * t), 1.0], rtol=1e-15)
        oscillation = -(0.79**2) * (now.position - [0.0, 1.0])
        np.testing.assert_allclose(now.acceleration, oscillation, atol=1e-15)


def test_circle_keeps_its_radius_and_spins_up_smoothly():
    """The motion starts at rest at centre + (R, 0), stays on the circle and reaches full rate."""
    centre, radius, rate, ramp = np.array([1.0, 2.0, 3.0]), 0.5, -1.7, 0.9
    motion = MOTIONS["circle"]
    start, full = motion(0.0), motion(2.0)
    np.testing.assert_array_equal(start.position, centre + np.array([radius, 0.0, 0.0]))
    np.testing.assert_array_equal([start.velocity, start.acceleration], np.zeros((2, 3)))
    for t in np.linspace(0.0, 3.0, 31):
        arm = motion(t).position - centre
        assert np.linalg.norm(arm) == pytest.approx(radius, rel=1e-14)
        assert arm @ motion(t).velocity == pytest.approx(0.0, abs=1e-14)
    np.testing.assert_allclose(
        full.acceleration, -(rate**2) * (full.position - centre), rtol=1e-13
    )

    def angular_rate(t):
        arm, velocity = motion(t).position - centre, motion(t).velocity
        return (arm[0] * velocity[1] - arm[1] * velocity[0]) / radius**2

    turned = quad(angular_rate, 0.0, 2.0, points=[ramp], epsabs=1e-12)[0]
    expected = centre[:2] + radius * np.array([np.cos(turned), np.sin(turned)])
    np.testing.assert_allclose(full.position[:2], expected, atol=1e-11)


def test_waypoints_are_the_quintic_hermite_interpolant_at_rest():
    """The motion equals the quintic through the points with zero rates and accelerations."""
    rest = np.zeros(2)
    hermite = BPoly.from_derivatives(TIMES, [[np.array(point), rest, rest] for point in POINTS])
    for t in np.linspace(0.0, 4.0, 81):
        now = MOTIONS["waypoints"](t)
        np.testing.assert_allclose(now.position, hermite(t), atol=1e-14)
        np.testing.assert_allclose(now.velocity, hermite.derivative(1)(t), atol=1e-12)
        np.testing.assert_allclose(now.acceleration, hermite.derivative(2)(t), atol=1e-11)


def test_waypoints_are_met_exactly_and_held_outside():
    """Each point is reached exactly at its time; before and after the motion is at rest."""
    for t, point in (*zip(TIMES, POINTS, strict=True), (-1.0, POINTS[0]), (9.0, POINTS[-1])):
        now = MOTIONS["waypoints"](t)
        np.testing.assert_array_equal(now.position, point)
        np.testing.assert_array_equal([now.velocity, now.acceleration], np.zeros((2, 2)))


def test_moves_rest_in_between():
    """The motion rests between two moves with a gap."""
    moves = RestToRest([1.0, 5.0], [2.0, 1.0], [[0.0], [4.0], [-4.0]])
    np.testing.assert_array_equal(
        [moves(t).position[0] for t in (0.0, 2.0, 4.0, 7.0)], [0, 2, 4, -4]
    )
    assert moves(4.0).velocity[0] == 0.0
    assert moves(2.0).velocity[0] == pytest.approx(4.0 / 2.0 * 1.875)


def test_a_single_value_is_held():
    """Without a move the motion rests at its only value."""
    np.testing.assert_array_equal(RestToRest([], [], [[1.0, 2.0]])(3.0).position, [1.0, 2.0])


def test_tremor_is_bounded_and_in_its_band():
    """The tremor stays below its amplitude and has no power outside 8 to 12 Hz."""
    trembling = motions.with_tremor(
        motions.still([0.0, 0.0]), 0.01, seed=5, layout=Layout.scalars(2)
    )
    samples = np.array([trembling(t).position for t in np.arange(0.0, 20.0, 0.01)])
    assert np.abs(samples).max() <= 0.01
    spectrum = np.abs(np.fft.rfft(samples * np.hanning(len(samples))[:, None], axis=0)) ** 2
    frequency = np.fft.rfftfreq(len(samples), 0.01)
    inside = (frequency > 8.0) & (frequency < 12.0)
    assert spectrum[~inside].sum() < 1e-6 * spectrum[inside].sum()


def test_tremor_is_determined_by_its_seed():
    """Equal seeds give equal bits; other seeds and other axes differ."""
    first, again, other = (
        motions.with_tremor(motions.still([0.0, 0.0]), 0.01, seed, Layout.scalars(2))(
            1.234
        ).position
        for seed in (7, 7, 8)
    )
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).min() > 1e-5
    assert abs(first[0] - first[1]) > 1e-5
