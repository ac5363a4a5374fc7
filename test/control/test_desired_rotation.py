# SPDX-License-Identifier: Apache-2.0
"""Desired motions with rotations: within limits, continuous, on SO(3) with exact derivatives."""

from itertools import pairwise

import numpy as np
import pytest

from noninteract_ros.control.references.desired_motion import DesiredMotion
from noninteract_ros.control.references.inputs import Rate, Target
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference

POSE = Layout((2,), (True,))
STEP = 2e-3
LIMITS = np.repeat([[1.0, 1.5], [5.0, 8.0], [50.0, 80.0]], (2, 3), axis=1)
TURN = np.array([0.5, -1.2, 0.8])


def value(*phi: float) -> np.ndarray:
    return np.concatenate([[0.3, -0.2], so3.exp(np.array(phi))])


def motion(direct: bool = False) -> DesiredMotion:
    desired = DesiredMotion(LIMITS, direct, POSE)
    desired.hold_at(value(0.1, 0.2, 0.3))
    return desired


def turning(t: float) -> Reference:
    """A full reference that is always on the move, about no fixed axis."""
    phase = 1.2 * t + np.arange(5.0)
    gap = 0.4 * np.sin(phase), 0.48 * np.cos(phase), -0.576 * np.sin(phase)
    return Reference.at_rest(value(*TURN), POSE).plus(Reference(*gap), POSE)


def run(desired: DesiredMotion, asked, seconds: float, start: float = 0.0) -> list[Reference]:
    """Advances with what `asked` gives at each tick."""
    count = round(seconds / STEP)
    return [desired.advance(asked(start + k * STEP), STEP) for k in range(1, count + 1)]


def assert_is_a_motion(way: list[Reference]) -> None:
    """Each derivative is that of the one before, with steps bounded by the limits."""
    max_velocity, max_acceleration, max_jerk = LIMITS[:, 4]
    v, a = (
        np.array([getattr(item, name) for item in way]) for name in ("velocity", "acceleration")
    )
    x_step = np.array([POSE.difference(b.position, a.position) for a, b in pairwise(way)])
    assert (np.linalg.norm(v[:, 2:], axis=1) <= 3**0.5 * max_velocity * (1 + 1e-9)).all()
    # Turning about an axis that moves adds up to half the squared rate to the acceleration.
    most = 3**0.5 * max_acceleration + 1.5 * max_velocity**2
    assert (np.linalg.norm(a[:, 2:], axis=1) <= most).all()
    jerk = 3**0.5 * max_jerk + 6.0 * max_velocity * most
    assert (np.linalg.norm(np.diff(a[:, 2:], axis=0), axis=1) <= jerk * STEP).all()
    assert np.abs(np.diff(v, axis=0) - STEP * (a[1:] + a[:-1]) / 2).max() <= jerk * STEP**2
    assert np.abs(x_step - STEP * (v[1:] + v[:-1]) / 2).max() <= most * STEP**2


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_set_point_is_turned_to_and_held(sign):
    """The motion ends at rest in the target, for both signs of its quaternion."""
    aim = value(*TURN)
    aim[2:] *= sign
    way = run(motion(), lambda t: Target(aim, np.zeros(5)), 4.0)
    assert_is_a_motion([motion().now, *way])
    np.testing.assert_allclose(POSE.difference(way[-1].position, aim), np.zeros(5), atol=1e-12)
    assert not way[-1].velocity.any()


@pytest.mark.parametrize("angle", [np.pi - 1e-9, np.pi, np.pi + 1e-9])
def test_a_set_point_half_a_turn_away_is_reached_without_a_jump(angle):
    """Opposite orientations are no special case: one way round is taken and kept."""
    desired = motion()
    start = desired.now.position
    turn = Reference(np.r_[0.0, 0.0, angle * np.array([0.6, 0.0, 0.8])], *np.zeros((2, 5)))
    aim = desired.now.plus(turn, POSE).position
    way = run(desired, lambda t: Target(aim, np.zeros(5)), 4.0)
    assert_is_a_motion(way)
    np.testing.assert_allclose(POSE.difference(way[-1].position, aim), np.zeros(5), atol=1e-12)
    middle = [np.linalg.norm(POSE.difference(item.position, start)) for item in way]
    assert (np.diff(middle[: len(way) // 4]) >= -1e-9).all()


def test_set_points_rates_and_timeouts_follow_each_other_smoothly():
    """Angular velocity and acceleration never jump as the input changes."""
    desired = motion()
    rate = np.array([0.2, 0.0, 0.7, -0.5, 0.3])
    way = [desired.now]
    way += run(desired, lambda t: Target(value(*TURN), np.zeros(5)), 0.5)
    way += run(desired, lambda t: Rate(rate), 1.5)
    np.testing.assert_allclose(way[-1].velocity, rate, atol=1e-9)
    way += run(desired, lambda t: Target(value(0.0, 0.0, 0.0), np.zeros(5)), 0.3)
    way += run(desired, lambda t: None, 2.0)
    assert_is_a_motion(way)
    assert not way[-1].velocity.any()


def test_a_take_over_starts_where_the_motion_is_and_ends_on_the_reference():
    """The gap to a moving reference closes on SO(3); a direct take-over is there at once."""
    desired = motion()
    way = [desired.now, *run(desired, turning, 3.0)]
    assert_is_a_motion(way[:2])
    x_step = POSE.difference(way[1].position, way[0].position)
    assert np.abs(x_step).max() < 4e-5
    end = turning(3.0)
    for name in ("position", "velocity", "acceleration"):
        np.testing.assert_array_equal(getattr(way[-1], name), getattr(end, name))
    for before, now, after in zip(way, way[1:], way[2:], strict=False):
        slope = POSE.difference(after.position, before.position) / (2 * STEP)
        np.testing.assert_allclose(now.velocity, slope, atol=8e-4)
    direct = motion(direct=True)
    assert direct.advance(turning(0.1), STEP).position is not None
    np.testing.assert_array_equal(direct.now.position, turning(0.1).position)


def test_references_that_are_extrapolated_are_no_jumps():
    """A reference each 10 ms, held on in between, is followed without a new take-over."""
    desired = motion(direct=False)
    layout = POSE

    def held(t: float) -> Reference:
        last = np.floor(t / 0.01 + 1e-9) * 0.01
        return turning(last).extrapolate(t - last, layout)

    run(desired, held, 3.0)
    way = run(desired, held, 0.2, start=3.0)
    for k, item in enumerate(way, 1):
        gap = layout.difference(item.position, turning(3.0 + k * STEP).position)
        assert np.abs(gap).max() < 1e-5
