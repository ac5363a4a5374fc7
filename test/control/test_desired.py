# SPDX-License-Identifier: Apache-2.0
"""Desired motion: within its limits and continuous."""

import numpy as np
import pytest

from noninteract_ros.control.references.desired_motion import DesiredMotion, MotionShaper
from noninteract_ros.control.references.inputs import Rate, Target
from noninteract_ros.subtasks.reference import Reference

STEP = 1e-3
LIMITS = np.array([[1.0, 0.5], [5.0, 3.0], [50.0, 40.0]])  # velocity, acceleration, jerk
START = np.array([0.3, -0.2])


def motion(direct: bool = False) -> DesiredMotion:
    desired = DesiredMotion(LIMITS, direct)
    desired.hold_at(START)
    return desired


def target(*position: float) -> Target:
    return Target(np.array(position), np.zeros(2))


def swing(t: float, amplitude: float = 0.2) -> Reference:
    """A full reference that is always on the move, well within the limits."""
    phase = 1.5 * t + np.array([0.0, 1.0])
    return Reference(
        amplitude * np.sin(phase) + 1.0,
        1.5 * amplitude * np.cos(phase),
        -2.25 * amplitude * np.sin(phase),
    )


def run(desired: DesiredMotion, asked, seconds: float, start: float = 0.0) -> list[Reference]:
    """Advances with what `asked` gives at each tick."""
    count = round(seconds / STEP)
    return [desired.advance(asked(start + k * STEP), STEP) for k in range(1, count + 1)]


def columns(way: list[Reference]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    names = ("position", "velocity", "acceleration")
    return tuple(np.array([getattr(item, name) for item in way]) for name in names)


def assert_is_a_motion(way: list[Reference], limits: np.ndarray = LIMITS) -> None:
    """Each derivative is that of the one before, and all are within limits."""
    x, v, a = columns(way)
    max_velocity, max_acceleration, max_jerk = limits
    assert (np.abs(v) <= max_velocity * (1 + 1e-9)).all()
    assert (np.abs(a) <= max_acceleration * (1 + 1e-9)).all()
    assert (np.abs(np.diff(a, axis=0)) <= max_jerk * STEP * (1 + 1e-6)).all()
    # Steps of a motion with bounded jerk: trapezoids are right to jerk * step^2 / 8 and / 24.
    v_step, x_step = np.diff(v, axis=0), np.diff(x, axis=0)
    assert (np.abs(v_step - STEP * (a[1:] + a[:-1]) / 2) <= max_jerk * STEP**2 / 4).all()
    assert (np.abs(x_step - STEP * (v[1:] + v[:-1]) / 2) <= max_acceleration * STEP**2 / 4).all()


def test_set_points_rates_and_timeouts_are_shaped_within_limits():
    """For all inputs, in any order and half-way, the motion keeps its three limits."""
    desired = motion()
    way = [desired.now]
    for asked in (
        target(2.0, 1.0),
        target(-1.0, 1.0),
        Rate(np.array([0.4, -0.4])),
        Rate(np.array([-9.0, 9.0])),
        None,
        target(0.0, 0.0),
        None,
        Rate(np.array([0.1, 0.0])),
        target(0.5, 0.5),
    ):
        way += run(desired, lambda t, asked=asked: asked, 0.37)
    assert_is_a_motion(way)
    assert np.ptp(columns(way)[0][:, 0]) > 0.3


def test_a_set_point_is_reached_exactly_and_kept():
    """The motion ends on the set-point, at rest, and stays without drift."""
    desired = motion()
    run(desired, lambda t: target(1.0, 0.4), 4.0)
    for item in run(desired, lambda t: target(1.0, 0.4), 0.1):
        np.testing.assert_array_equal(item.position, [1.0, 0.4])
        np.testing.assert_array_equal(item.velocity, [0.0, 0.0])
        np.testing.assert_array_equal(item.acceleration, [0.0, 0.0])


def test_a_rate_is_reached_and_bounded():
    """A rate is taken up exactly where it is within the limit, and at the limit beyond."""
    way = run(motion(), lambda t: Rate(np.array([0.4, -9.0])), 2.0)
    np.testing.assert_allclose(way[-1].velocity, [0.4, -0.5], atol=1e-12)
    np.testing.assert_allclose(way[-1].acceleration, [0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("direct", [False, True])
def test_a_timeout_brings_the_motion_to_rest_within_limits(direct):
    """When a moving reference times out, the motion stops within its limits and stays."""
    desired = motion(direct)
    run(desired, swing, 6.0)
    way = [desired.now, *run(desired, lambda t: None, 1.0)]
    assert np.abs(way[0].velocity).max() > 0.1
    assert_is_a_motion(way)
    assert not way[-1].velocity.any()
    assert not way[-1].acceleration.any()
    np.testing.assert_array_equal(way[-1].position, way[-100].position)


def test_direct_take_over_passes_the_reference_unchanged():
    """`direct` hands on the reference from its first tick, with the jump it brings."""
    for k, item in enumerate(run(motion(direct=True), swing, 0.01), start=1):
        np.testing.assert_array_equal(item.position, swing(k * STEP).position)
        np.testing.assert_array_equal(item.acceleration, swing(k * STEP).acceleration)


def assert_joins(before: Reference, way: list[Reference]) -> None:
    """Check that a motion joins `before`, within limits on top of the reference's motion."""
    own = np.array([[0.3, 0.3], [0.45, 0.45], [0.7, 0.7]])  # What `swing` itself needs.
    assert_is_a_motion([before, *way], LIMITS + own)


def test_shaped_take_over_starts_where_the_motion_is_and_ends_on_the_reference():
    """A full reference far away is joined from rest without a jump, then followed exactly."""
    desired = motion()
    way = run(desired, swing, 6.0)
    assert_joins(Reference.at_rest(START), way)
    for item, k in zip(way[-100:], range(5901, 6001), strict=True):
        np.testing.assert_array_equal(item.position, swing(k * STEP).position)
        np.testing.assert_array_equal(item.velocity, swing(k * STEP).velocity)


def test_a_reference_that_jumps_is_rejoined_without_a_jump():
    """A jump inside a stream of references is closed smoothly, as a take-over is."""
    desired = motion()
    run(desired, swing, 6.0)
    before = desired.now

    def jumped(t):
        own = swing(t)
        return Reference(own.position + 0.7, own.velocity, own.acceleration)

    way = run(desired, jumped, 4.0, start=6.0)
    assert_joins(before, way)
    np.testing.assert_array_equal(way[-1].position, jumped(10.0).position)


def test_changes_between_full_references_and_set_points_have_no_jump():
    """From a reference to a set-point and back the motion goes on from where it is."""
    desired = motion()
    way = [desired.now]
    way += run(desired, swing, 0.5)
    way += run(desired, lambda t: target(0.0, 0.0), 0.3)
    way += run(desired, swing, 0.6, start=0.8)
    way += run(desired, lambda t: Rate(np.array([0.2, 0.2])), 0.3)
    way += run(desired, swing, 0.3, start=1.7)
    way += run(desired, lambda t: None, 0.3)
    assert_joins(way[0], way[1:])


def test_slow_references_that_are_extrapolated_are_no_jumps():
    """References at 100 Hz, extrapolated to each tick, are followed without a gap once joined."""
    desired = motion()
    run(desired, swing, 6.0)
    worst = 0.0
    for k in range(1, 1001):
        t = 6.0 + k * STEP
        spoken = np.floor(t * 100.0 + 1e-9) / 100.0
        item = desired.advance(swing(spoken).extrapolate(t - spoken), STEP)
        worst = max(worst, np.abs(item.position - swing(t).position).max())
    assert worst < 1e-6


def test_a_noisy_reference_is_followed():
    """References that jump at every tick keep the motion near their mean."""
    desired = motion()
    rng = np.random.default_rng(2)
    zero = np.zeros(2)

    def noisy(t):
        return Reference(1.0 + 2e-3 * rng.normal(size=2), zero, zero)

    way = run(desired, noisy, 5.0)
    np.testing.assert_allclose(columns(way)[0][-2000:], 1.0, atol=0.05)


def test_a_spike_of_acceleration_before_a_timeout_moves_nothing():
    """A source whose last input is an acceleration of 500 m/s^2 leaves the motion where it was."""
    desired = motion(direct=True)
    desired.advance(Reference(START, np.zeros(2), np.array([500.0, -300.0])), STEP)
    way = run(desired, lambda t: None, 3.0)
    assert np.abs(columns(way)[0] - START).max() < 0.5
    assert not way[-1].velocity.any()


@pytest.mark.parametrize("distance", [1e4, 1e9, 1e15])
def test_a_very_distant_set_point_is_approached_at_the_limit(distance):
    """A target far beyond what can be planned is approached at bounded velocity, without error."""
    desired = motion()
    way = run(desired, lambda t: target(distance, -distance), 1.0)
    assert_is_a_motion(way)
    np.testing.assert_allclose(way[-1].velocity, [1.0, -0.5], rtol=1e-4)


def test_any_start_has_a_next_step():
    """From starts far beyond the limits the next state is finite, and where they lead to."""
    rng = np.random.default_rng(0)
    shaper = MotionShaper(LIMITS)
    for k in range(3000):
        scale = np.exp(rng.uniform(-20.0, 6.0, (3, 1)))
        start = Reference(*(rng.normal(size=(3, 2)) * scale))
        if k % 3:
            item, _ = shaper.towards(start, target(*rng.normal(size=2)), STEP)
        else:
            item, _ = shaper.at_rate(start, rng.normal(size=2), STEP)
        reach = (np.abs(start.velocity) + 0.5 * STEP * np.abs(start.acceleration)) * STEP + 1e-5
        assert (np.abs(item.position - start.position) <= reach).all()
        assert np.isfinite([item.velocity, item.acceleration]).all()


def test_no_time_no_motion():
    """A step of no length, as at a restart, changes nothing."""
    for asked in (target(1.0, 1.0), Rate(np.ones(2)), None, swing(0.3)):
        item = motion().advance(asked, 0.0)
        np.testing.assert_allclose(item.position, START, atol=1e-15)
        np.testing.assert_allclose(item.velocity, [0.0, 0.0], atol=1e-15)


def test_rest_keeps_its_own_copy():
    """The place of rest does not follow the array it was given in."""
    place = START.copy()
    desired = DesiredMotion(LIMITS, False)
    desired.hold_at(place)
    place += 1.0
    np.testing.assert_array_equal(desired.advance(None, STEP).position, START)
