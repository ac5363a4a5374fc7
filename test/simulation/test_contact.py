# SPDX-License-Identifier: Apache-2.0
"""Couplings: forces are gradients of potentials, losses are never negative."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from noninteract_ros.simulation.contact import Coupling, FrameMotion, Grip, WallContact

STEP = 1e-6
GRIP = Grip(("a", "b"), 300.0, 7.0, 20.0, 0.8)
WALL = WallContact(("a",), np.array([0.2, 0.1, 0.0]), np.array([0.6, 0.8, 0.0]), 5e3, 0.7)


def motion(rng: np.random.Generator, speed: float = 1.0, size: float = 0.3) -> FrameMotion:
    """Return a frame near the origin with random orientation and motion."""
    return FrameMotion(
        rng.uniform(-size, size, 3),
        Rotation.from_rotvec(rng.uniform(-1.0, 1.0, 3)).as_matrix(),
        speed * rng.uniform(-1.0, 1.0, 3),
        speed * rng.uniform(-1.0, 1.0, 3),
    )


def moved(frame: FrameMotion, twist: np.ndarray) -> FrameMotion:
    """Return a frame at rest, displaced by a small twist (6,) in world axes."""
    rotation = Rotation.from_rotvec(twist[3:]).as_matrix() @ frame.rotation
    return FrameMotion(frame.position + twist[:3], rotation, np.zeros(3), np.zeros(3))


def gradient(coupling: Coupling, frames: list[FrameMotion], index: int) -> np.ndarray:
    """Return the derivative of the potential by a twist of one frame, shape (6,)."""
    found = []
    for direction in np.eye(6):
        values = []
        for sign in (1.0, -1.0):
            changed = list(frames)
            changed[index] = moved(frames[index], sign * STEP * direction)
            values.append(coupling.effect(tuple(changed)).potential)
        found.append((values[0] - values[1]) / (2.0 * STEP))
    return np.array(found)


def power(coupling: Coupling, frames: list[FrameMotion]) -> float:
    """Return the power of a coupling on its frames."""
    effect = coupling.effect(tuple(frames))
    return sum(
        wrench @ np.concatenate([frame.velocity, frame.angular_velocity])
        for wrench, frame in zip(effect.wrenches, frames, strict=True)
    )


def in_wall(rng: np.random.Generator, depth: float, depth_rate: float) -> FrameMotion:
    """Return a frame at a depth in the wall with a normal speed and random sliding."""
    along = np.array([-0.8, 0.6, 0.0])
    slide = rng.uniform(-1.0, 1.0, 2)
    position = WALL.point - depth * WALL.normal + slide[0] * along
    velocity = -depth_rate * WALL.normal + slide[1] * along
    return FrameMotion(position, np.eye(3), velocity, rng.uniform(-1.0, 1.0, 3))


def test_wrenches_at_rest_are_gradients_of_the_potential():
    """Of grips in six dimensions, for both frames, and of walls, by finite differences."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        pair = [motion(rng, 0.0), motion(rng, 0.0)]
        wrenches = GRIP.effect(tuple(pair)).wrenches
        for index in (0, 1):
            np.testing.assert_allclose(wrenches[index], -gradient(GRIP, pair, index), atol=1e-6)
        touching = [in_wall(rng, rng.uniform(1e-3, 0.1), 0.0)]
        still = FrameMotion(touching[0].position, np.eye(3), np.zeros(3), np.zeros(3))
        (wrench,) = WALL.effect((still,)).wrenches
        np.testing.assert_allclose(wrench, -gradient(WALL, touching, 0), atol=1e-5)


def test_the_torque_of_a_grip_follows_the_rotation_vector():
    """A twist of 0.5 rad about an oblique axis has the torque 20 * 0.5 N m against it."""
    axis = np.array([1.0, 2.0, -2.0]) / 3.0
    start = Rotation.from_rotvec([0.3, -0.2, 0.9])
    turned = (Rotation.from_rotvec(0.5 * axis) * start).as_matrix()
    frames = [
        FrameMotion(np.zeros(3), R, np.zeros(3), np.zeros(3)) for R in (start.as_matrix(), turned)
    ]
    first, second = GRIP.effect(tuple(frames)).wrenches
    np.testing.assert_allclose(first, [0.0, 0.0, 0.0, *(10.0 * axis)], atol=1e-12)
    np.testing.assert_allclose(second, -first, atol=1e-12)


def test_power_is_dissipated_or_stored():
    """Power taken by a coupling is growth of its potential plus what it dissipates, >= 0."""
    rng = np.random.default_rng(1)
    for _ in range(200):
        pair = [motion(rng), motion(rng)]
        touching = [in_wall(rng, rng.uniform(-0.01, 0.1), rng.uniform(-4.0, 4.0))]
        for coupling, frames in ((GRIP, pair), (WALL, touching)):
            ahead, behind = (
                [
                    moved(f, sign * STEP * np.concatenate([f.velocity, f.angular_velocity]))
                    for f in frames
                ]
                for sign in (1.0, -1.0)
            )
            potentials = [coupling.effect(tuple(side)).potential for side in (ahead, behind)]
            growth = (potentials[0] - potentials[1]) / (2.0 * STEP)
            dissipated = coupling.effect(tuple(frames)).dissipated
            assert dissipated >= 0.0
            assert -power(coupling, frames) == pytest.approx(growth + dissipated, abs=1e-4)


def test_grips_act_and_react():
    """Forces and torques on the two frames are opposite, whatever the motion."""
    rng = np.random.default_rng(2)
    for _ in range(20):
        first, second = GRIP.effect((motion(rng), motion(rng))).wrenches
        np.testing.assert_array_equal(first, -second)
        assert np.abs(first).min() > 0.0


def test_a_grip_without_rotational_gains_exerts_no_torque():
    """Frames held at a point rotate freely."""
    rng = np.random.default_rng(3)
    first, _ = Grip(("a", "b"), 100.0, 1.0).effect((motion(rng), motion(rng))).wrenches
    assert first[:3].all()
    assert not first[3:].any()


def test_a_wall_pushes_along_its_normal_and_never_pulls():
    """At any speed the force is along the normal or zero; outside it is zero."""
    rng = np.random.default_rng(4)
    pulls = 0
    for depth in np.linspace(-0.05, 0.05, 41):
        for depth_rate in np.linspace(-5.0, 5.0, 41):
            effect = WALL.effect((in_wall(rng, depth, depth_rate),))
            (wrench,) = effect.wrenches
            force = wrench[:3] @ WALL.normal
            assert force >= 0.0
            np.testing.assert_allclose(wrench[:3], force * WALL.normal, atol=1e-12)
            assert not wrench[3:].any()
            if depth <= -1e-9:
                assert not wrench.any()
                assert effect.potential == effect.dissipated == 0.0
            pulls += depth > 1e-9 and force == 0.0
    assert pulls > 100  # Where a linear damper would have pulled.


def test_a_wall_s_force_is_continuous():
    """The force has no step at the start, the end and the cut-off of contact."""
    rng = np.random.default_rng(5)
    for depth_rate in (-5.0, -1.0 / WALL.damping, -0.3, 0.0, 2.0):
        depths = np.arange(-1e-3, 1e-3, 1e-6)
        forces = [WALL.effect((in_wall(rng, d, depth_rate),)).wrenches[0][:3] for d in depths]
        steps = np.linalg.norm(np.diff(forces, axis=0), axis=1)
        bound = WALL.stiffness * 1e-6 * max(1.0, 1.0 + WALL.damping * depth_rate)
        assert steps.max() <= bound * (1.0 + 1e-6)
    speeds = np.arange(-3.0, 0.0, 1e-3)
    forces = [WALL.effect((in_wall(rng, 0.01, s),)).wrenches[0][:3] for s in speeds]
    steps = np.linalg.norm(np.diff(forces, axis=0), axis=1)
    assert steps.max() <= WALL.stiffness * 0.01 * WALL.damping * 1e-3 * (1.0 + 1e-6)


def test_a_wall_s_potential_is_that_of_its_depth():
    """Hooke's law: 5 kN/m over 10 mm are 50 N and 0.25 J."""
    effect = WALL.effect((in_wall(np.random.default_rng(6), 0.01, 0.0),))
    np.testing.assert_allclose(effect.wrenches[0][:3], 50.0 * WALL.normal, rtol=1e-12)
    assert effect.potential == pytest.approx(0.25)
    assert effect.dissipated == 0.0
