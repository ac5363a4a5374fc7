# SPDX-License-Identifier: Apache-2.0
"""States of different stamps, assembled to one: exact for equal stamps, bounded otherwise."""

from dataclasses import dataclass

import numpy as np
import pytest

from noninteract_ros.team.state_assembler import StateAssembler

NAMES = ["left/a", "left/b", "right/a", "right/b"]
LEFT, RIGHT = np.array([0, 1]), np.array([2, 3])
MILLISECOND = 10**6


@dataclass
class Motion:
    """Joints that swing: q = A sin(w t + p)."""

    amplitude: np.ndarray
    frequency: np.ndarray
    phase: np.ndarray

    def at(self, time_ns: int, order: int) -> np.ndarray:
        """The derivative of an order at a time."""
        angle = self.frequency * time_ns * 1e-9 + self.phase + order * np.pi / 2.0
        return self.amplitude * self.frequency**order * np.sin(angle)

    def largest(self, order: int) -> np.ndarray:
        """Bound of that derivative."""
        return self.amplitude * self.frequency**order


MOTION = Motion(
    np.array([0.4, 0.2, 0.3, 0.5]), np.array([2.0, 7.0, 5.0, 3.0]), np.array([0.0, 1.0, 2.0, 0.7])
)


def update(assembler: StateAssembler, joints: np.ndarray, stamp: int) -> None:
    assembler.update(joints, stamp, MOTION.at(stamp, 0)[joints], MOTION.at(stamp, 1)[joints])


def worst(prediction: str, offset_ns: int) -> tuple[np.ndarray, np.ndarray]:
    """Largest errors of the joints' positions and velocities, the right robot's states offset."""
    assembler = StateAssembler(NAMES, prediction, 0.02)
    errors = []
    for tick in range(2000):
        stamp = tick * MILLISECOND
        update(assembler, RIGHT, stamp)
        if tick < 5:  # So that accelerations are known.
            update(assembler, LEFT, stamp)
            continue
        update(assembler, LEFT, stamp + offset_ns)
        state = assembler.assemble()
        assert state.stamp_ns == stamp + offset_ns
        assert not state.late.any()
        np.testing.assert_allclose(state.ages[RIGHT], offset_ns * 1e-9)
        true = MOTION.at(state.stamp_ns, 0), MOTION.at(state.stamp_ns, 1)
        errors.append([state.position - true[0], state.velocity - true[1]])
    position, velocity = np.abs(errors).max(axis=0)
    return position, velocity


@pytest.mark.parametrize("prediction", ["velocity", "acceleration"])
def test_equal_stamps_change_nothing(prediction: str) -> None:
    """With equal stamps the assembled state is the received one, to the bit."""
    assembler = StateAssembler(NAMES, prediction, 0.02)
    for tick in range(50):
        update(assembler, RIGHT, tick * MILLISECOND)
        update(assembler, LEFT, tick * MILLISECOND)
        assert assembler.simultaneous
        state = assembler.assemble()
        np.testing.assert_array_equal(state.position, MOTION.at(tick * MILLISECOND, 0))
        np.testing.assert_array_equal(state.velocity, MOTION.at(tick * MILLISECOND, 1))


@pytest.mark.parametrize("offset_ms", [0.5, 1.0, 2.0, 3.0])
def test_constant_velocity_errs_by_no_more_than_the_acceleration_allows(offset_ms: float) -> None:
    """At most a d^2 / 2 in position and a d in velocity, and near that: the bound is sharp."""
    d = offset_ms * 1e-3
    position, velocity = worst("velocity", round(offset_ms * MILLISECOND))
    a = MOTION.largest(2)
    assert not position[LEFT].any()
    assert not velocity[LEFT].any()
    assert (position[RIGHT] <= 0.5 * a[RIGHT] * d**2).all()
    assert (position[RIGHT] >= 0.45 * a[RIGHT] * d**2).all()
    assert (velocity[RIGHT] <= a[RIGHT] * d).all()
    assert (velocity[RIGHT] >= 0.9 * a[RIGHT] * d).all()


@pytest.mark.parametrize("offset_ms", [0.5, 1.0, 2.0, 3.0])
def test_measured_acceleration_errs_one_order_less(offset_ms: float) -> None:
    """At most j (d^3 / 6 + h d^2 / 4) and j (d^2 + h d) / 2, with h = 1 ms between states."""
    d, h = offset_ms * 1e-3, 1e-3
    position, velocity = worst("acceleration", round(offset_ms * MILLISECOND))
    j = MOTION.largest(3)[RIGHT]
    assert (position[RIGHT] <= j * (d**3 / 6.0 + h * d**2 / 4.0) * 1.001).all()
    assert (position[RIGHT] >= 0.8 * j * (d**3 / 6.0 + h * d**2 / 4.0)).all()
    assert (velocity[RIGHT] <= j * (d**2 + h * d) / 2.0 * 1.001).all()
    assert (velocity[RIGHT] >= 0.8 * j * (d**2 + h * d) / 2.0).all()


def test_a_repeated_state_keeps_the_acceleration() -> None:
    """A repeated message, as after a lost response, carries no new information."""
    assembler = StateAssembler(NAMES, "acceleration", 0.02)
    for tick in (0, 1, 1):
        update(assembler, RIGHT, tick * MILLISECOND)
    update(assembler, LEFT, 3 * MILLISECOND)
    state = assembler.assemble()
    expected = MOTION.at(3 * MILLISECOND, 1)
    assert (np.abs(state.velocity - expected)[RIGHT] < 0.1 * MOTION.largest(2)[RIGHT] * 2e-3).all()


def test_a_late_robot_rests_where_it_was() -> None:
    """Beyond the bound there is no prediction: last position, no velocity; the others go on."""
    assembler = StateAssembler(NAMES, "velocity", 0.02)
    update(assembler, RIGHT, 0)
    update(assembler, LEFT, 20 * MILLISECOND)
    assert not assembler.assemble().late.any()
    update(assembler, LEFT, 21 * MILLISECOND)
    state = assembler.assemble()
    np.testing.assert_array_equal(state.late, [False, False, True, True])
    np.testing.assert_array_equal(state.position[RIGHT], MOTION.at(0, 0)[RIGHT])
    assert not state.velocity[RIGHT].any()
    np.testing.assert_array_equal(state.velocity[LEFT], MOTION.at(21 * MILLISECOND, 1)[LEFT])
    update(assembler, RIGHT, 21 * MILLISECOND)
    assert not assembler.assemble().late.any()


def test_joints_may_arrive_one_by_one() -> None:
    """A message may hold some joints only; there is no state before every joint is known."""
    assembler = StateAssembler(NAMES, "velocity", 0.02)
    for joint in range(4):
        assert not assembler.ready
        assert assembler.missing == NAMES[joint:]
        update(assembler, np.array([joint]), joint * MILLISECOND // 4)
    assert assembler.ready
    assert not assembler.simultaneous
    state = assembler.assemble()
    assert not assembler.ready
    np.testing.assert_allclose(state.ages, [0.75e-3, 0.5e-3, 0.25e-3, 0.0])
    assembler.reset(LEFT)
    assert assembler.missing == NAMES[:2]
    assert not assembler.ready


def test_efforts_are_the_measured_ones() -> None:
    """Efforts are NaN where none was received, or NaN."""
    assembler = StateAssembler(NAMES, "velocity", 0.02)
    update(assembler, LEFT, 0)
    nothing = np.zeros(2)
    assembler.update(RIGHT, 0, nothing, nothing, np.array([3.0, np.nan]))
    np.testing.assert_array_equal(assembler.assemble().effort, [np.nan, np.nan, 3.0, np.nan])
