# SPDX-License-Identifier: Apache-2.0
"""Accelerations beyond their bound at a hand-over: reduced with bounded jerk, without a step."""

from collections.abc import Callable

import numpy as np
import pytest

from noninteract_ros.control.references.desired_motion import DesiredMotion
from noninteract_ros.control.references.inputs import MotionInput, Rate, Target
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference

STEP = 2e-3
POSE = Layout((3,), (True,))
BOUNDS = np.repeat([[1.0, 1.5], [5.0, 8.0], [50.0, 80.0]], 3, axis=1)
MAX_VELOCITY, MAX_ACCELERATION, MAX_JERK = BOUNDS
PUSH = 0.05  # [s] in which a source accelerates before it leaves
SWAYS = np.array([0.3, -0.2, 0.25, 0.2, -0.3, 0.25]), 1.2 + 0.3 * np.arange(6.0)


def swaying(t: float) -> Reference:
    """A full reference well within the bounds, about no fixed axis."""
    size, w = SWAYS
    gap = size * np.sin(w * t), w * size * np.cos(w * t), -w * w * size * np.sin(w * t)
    centre = np.concatenate([[0.3, -0.2, 0.5], so3.exp(np.array([0.3, -0.4, 0.2]))])
    return Reference.at_rest(centre, POSE).plus(Reference(*gap), POSE)


def aim(_: float) -> Target:
    turned = so3.exp(np.array([0.2, -0.5, 0.6]))
    return Target(np.concatenate([[0.1, 0.1, 0.3], turned]), np.zeros(6))


TAKERS = {
    "nobody": lambda t: None,
    "a rate": lambda t: Rate(np.array([0.3, -0.2, 0.1, 0.4, -0.3, 0.2])),
    "a set-point": aim,
    "a full reference": swaying,
}


def left(velocity: np.ndarray, acceleration: np.ndarray) -> DesiredMotion:
    """Motion whose source leaves it with a velocity and an acceleration, shape (6,) each."""
    value = np.concatenate([[0.4, 0.1, 0.2], so3.exp(np.array([0.5, 0.1, -0.3]))])
    end, v, a = Reference.at_rest(value, POSE), velocity, acceleration

    def source(t: float) -> Reference:
        s = max(t, -PUSH)
        rate, growth = v + a * (s + s * s / (2.0 * PUSH)), a * (1.0 + s / PUSH)
        way = v * s + a * (s * s / 2.0 + s**3 / (6.0 * PUSH)) + rate * (t - s)
        return end.plus(Reference(way, rate, growth), POSE)

    count = round(1.2 / STEP)
    desired = DesiredMotion(BOUNDS, False, POSE)
    desired.hold_at(source(-count * STEP).position)
    for k in range(1 - count, 1):
        desired.advance(source(k * STEP), STEP)
    np.testing.assert_allclose(desired.now.acceleration, acceleration, rtol=1e-9)
    return desired


def hand_over(
    desired: DesiredMotion, taker: Callable[[float], MotionInput | None], seconds: float
) -> list[Reference]:
    """Motion from the last one of the former source on."""
    count = round(seconds / STEP)
    return [desired.now, *(desired.advance(taker(k * STEP), STEP) for k in range(1, count + 1))]


def accelerations(way: list[Reference]) -> np.ndarray:
    return np.array([item.acceleration for item in way])


@pytest.mark.parametrize("name", TAKERS)
def test_the_acceleration_never_steps_at_a_take_over(name: str) -> None:
    """For any difference of two sources within the bounds, |da| <= max_jerk dt all along."""
    rng = np.random.default_rng(5)
    own = np.array([np.abs(size * w**3).max() for size, w in (np.array(SWAYS),)]).max()
    for _ in range(4):
        acceleration = rng.choice([-1.0, 1.0], 6) * rng.uniform(0.8, 2.0, 6) * MAX_ACCELERATION
        velocity = rng.uniform(-0.5, 0.5, 6) * MAX_VELOCITY
        way = hand_over(left(velocity, acceleration), TAKERS[name], 3.0)
        steps = np.abs(np.diff(accelerations(way), axis=0))
        assert np.abs(way[0].acceleration).max() > 1.2 * MAX_ACCELERATION[0]
        assert (steps[:, :3] <= (MAX_JERK[:3] + own) * STEP * (1.0 + 1e-6)).all()
        rates = np.linalg.norm([item.velocity[3:] for item in way], axis=1).max()
        most = np.linalg.norm(accelerations(way)[:, 3:], axis=1).max()
        turned = 3.0**0.5 * (MAX_JERK[3] + own) + 3.0 * rates * most + rates**3
        assert (np.linalg.norm(steps[:, 3:], axis=1) <= turned * STEP).all()


@pytest.mark.parametrize("name", TAKERS)
def test_the_new_source_is_reached(name: str) -> None:
    """The motion ends on that of the new source; all derivatives are consistent."""
    way = hand_over(left(0.3 * MAX_VELOCITY, 1.8 * MAX_ACCELERATION), TAKERS[name], 6.0)
    asked, end = TAKERS[name](6.0), way[-1]
    if isinstance(asked, Rate):
        np.testing.assert_allclose(end.velocity, asked.velocity, atol=1e-9)
    elif isinstance(asked, Reference):
        np.testing.assert_array_equal(end.position, asked.position)
    else:
        assert not end.velocity.any()
    assert asked is None or isinstance(asked, Rate) or np.allclose(end.position, asked.position)
    v, a = (
        np.array([getattr(item, key)[:3] for item in way]) for key in ("velocity", "acceleration")
    )
    drift = np.diff(v, axis=0) - 0.5 * STEP * (a[1:] + a[:-1])
    assert np.abs(drift).max() <= 1.1 * MAX_JERK[0] * STEP**2 / 4.0


def test_larger_accelerations_are_reduced_without_a_step_within_the_velocity_bound() -> None:
    """With a high jerk, a hard push of the hand ends without a step and within bounds."""
    bounds = np.array([[1.0], [5.0], [1000.0]])
    desired = DesiredMotion(bounds, True)
    desired.advance(Reference(np.zeros(1), np.array([0.2]), np.array([38.0])), STEP)
    way = hand_over(desired, TAKERS["nobody"], 1.0)
    assert np.abs(np.diff(accelerations(way), axis=0)).max() <= 1000.0 * STEP * (1.0 + 1e-6)
    assert max(item.velocity[0] for item in way) <= 1.0
    assert not way[-1].velocity.any()


@pytest.mark.parametrize("acceleration", [30.0, -500.0, 1e9])
def test_accelerations_beyond_both_bounds_are_cut(acceleration: float) -> None:
    """Beyond both, it is cut to twice the bound: at most 2 max_velocity and 0.4 m result."""
    desired = DesiredMotion(BOUNDS[:, :1], True)
    desired.advance(Reference(np.zeros(1), np.zeros(1), np.array([acceleration])), STEP)
    way = hand_over(desired, TAKERS["nobody"], 2.0)
    assert np.abs(way[1].acceleration).max() == pytest.approx(10.0, abs=50.0 * STEP)
    steps = np.abs(np.diff(accelerations(way[1:]), axis=0))
    assert steps.max() <= 50.0 * STEP * (1.0 + 1e-6)
    assert max(np.abs(item.velocity[0]) for item in way) <= 2.0
    assert np.abs(way[-1].position[0]) < 0.4
