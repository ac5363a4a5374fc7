# SPDX-License-Identifier: Apache-2.0
"""Motions, hands and formations with rotations: exact derivatives, geodesics, errors."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import load
from noninteract_ros.sources.autonomy.planner import Formation, FormationPlanner, PlannerSettings
from noninteract_ros.sources.human import motion as motions
from noninteract_ros.sources.human.hand import Hand, RotatingHand
from noninteract_ros.sources.human.haptic_device import HapticDevice, HapticSettings
from noninteract_ros.sources.human.replay import replay
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference

POSE = Layout((3,), (True,))
TURN = Layout((0,), (True,))
TWO = Layout((3, 3), (True, True))
STEP = 1e-4
HALF = 0.5**0.5
Q_X, Q_Y, Q_Z = (HALF, 0.0, 0.0, HALF), (0.0, HALF, 0.0, HALF), (0.0, 0.0, HALF, HALF)
NONE = (0.0, 0.0, 0.0, 1.0)


def device(layout: Layout = POSE, **values) -> HapticDevice:
    """Build a device from keys of a scenario file."""
    return HapticDevice(load(HapticSettings, values, "haptic"), layout)


def intended(layout: Layout = POSE, **values):
    """Return the intended motion of a device."""
    return device(layout, **values)._motion


def recorded(count: int = 30):
    """Return a recording of a smooth motion of a pose."""
    times = np.linspace(2.0, 5.0, count)
    phi = np.stack([np.sin(times), 0.5 * np.cos(2 * times), 0.3 * times], axis=1)
    return times, np.hstack([phi, -so3.exp(phi)])


def rotating_motions():
    six = {"points": [0.0, 0, 0, 1, -1, 0.5, 2, 2, 2], "times": [0.0, 1.0, 2.5]}
    swing = {"amplitude": [0.1, 0.2, 0.3], "offset": [1.0, 2.0, 3.0], "rotation": [0.7, -0.4, 1.1]}
    return {
        "swing": intended(orientation=Q_X, **swing),
        "swing with tremor": intended(tremor_amplitude=0.01, tremor_angle=0.02, **swing),
        "circle": intended(
            motion="circle", centre=[1.0, 2.0, 3.0], rotation=[0.5, 0.2, -0.3], orientation=Q_Z
        ),
        "waypoints": intended(motion="waypoints", orientations=NONE + Q_X + Q_Z, **six),
        "rotation only": intended(
            TURN, motion="waypoints", times=[0.0, 1.0, 2.5], orientations=NONE + Q_X + Q_Y
        ),
        "replay": replay(*recorded(), POSE),
        "formations": planner(
            Formation((1.0, 0, 0, *Q_X)), Formation((0, 2.0, 0, *Q_Y), 1.0, 1.5)
        ),
    }


def planner(*formations: Formation, layout: Layout = POSE):
    named = dict(zip("abc", formations, strict=False))
    return FormationPlanner(PlannerSettings(formations=tuple(named)), named, layout)._motion


@pytest.mark.parametrize("name", rotating_motions())
def test_derivatives_match_finite_differences(name):
    """Velocities are derivatives of values, in world axes, and accelerations of velocities."""
    motion = rotating_motions()[name]
    layout = TURN if name == "rotation only" else POSE
    for t in np.random.default_rng(1).uniform(0.01, 2.4, 20):
        before, now, after = motion(t - STEP), motion(t), motion(t + STEP)
        velocity = layout.difference(after.position, before.position) / (2 * STEP)
        acceleration = (after.velocity - before.velocity) / (2 * STEP)
        scale = 100.0 if "tremor" in name else 1.0
        np.testing.assert_allclose(now.velocity, velocity, atol=1e-6 * scale)
        np.testing.assert_allclose(now.acceleration, acceleration, atol=2e-6 * scale**2)
        assert np.linalg.norm(now.position[-4:]) == pytest.approx(1.0, abs=1e-14)


def test_the_default_rotation_is_none():
    """Without a rotation the orientation is held; without an orientation there is no turn."""
    circle = {"motion": "circle", "centre": [0.0, 0.0, 0.0]}
    for keys, expected in (({}, NONE), ({"orientation": Q_Y}, Q_Y)):
        now = intended(**circle, **keys)(1.7)
        np.testing.assert_allclose(now.position[3:], expected, atol=1e-15)
        np.testing.assert_array_equal([now.velocity[3:], now.acceleration[3:]], np.zeros((2, 3)))
    held = intended(motion="still", centre=[1.0, 2.0, 3.0], orientation=Q_Z)(9.0)
    np.testing.assert_allclose(held.position, [1.0, 2.0, 3.0, *Q_Z], rtol=1e-15)
    assert held.velocity.shape == held.acceleration.shape == (6,)


def test_waypoints_rotate_the_shortest_way_about_one_axis():
    """The motion is slerp in minimum-jerk time, for any signs of the quaternions."""
    keys = {"motion": "waypoints", "times": [0.0, 2.0], "points": [0.0] * 6}
    motion = intended(orientations=Q_X + tuple(-q for q in Q_Y), **keys)
    ends = Rotation.from_quat([Q_X, Q_Y])
    whole = (ends[1] * ends[0].inv()).as_rotvec()
    for t in np.linspace(0.0, 2.0, 9):
        u = t / 2.0
        share = u**3 * (10 - 15 * u + 6 * u**2)
        expected = Rotation.from_rotvec(share * whole) * ends[0]
        now = motion(t)
        found = Rotation.from_quat(now.position[3:])
        assert (found * expected.inv()).magnitude() < 1e-7
        np.testing.assert_allclose(np.cross(now.velocity[3:], whole), np.zeros(3), atol=1e-12)


def test_a_recording_passes_through_its_samples():
    """Positions and orientations of all samples are met, for any signs of the quaternions."""
    times, values = recorded()
    motion = replay(times, values, POSE)
    for t, value in zip(times, values, strict=True):
        gap = POSE.difference(motion(t - times[0]).position, value)
        np.testing.assert_allclose(gap, np.zeros(6), atol=1e-12)


def test_a_recording_is_read_from_a_file(tmp_path):
    """A CSV with quaternions is replayed; one with an invalid quaternion is rejected."""
    file = tmp_path / "hand.csv"
    header = "t,x,y,z,qx,qy,qz,qw\n"
    file.write_text(header + "0,1,2,3,0,0,0,1\n1,1,2,3,0.6,0,0,0.8\n")
    now = device(motion="replay", file=str(file)).sample(1.0)
    np.testing.assert_allclose(now.position, [1, 2, 3, 0.6, 0, 0, 0.8], atol=1e-14)
    file.write_text(header + "0,1,2,3,0,0,0,1\n1,1,2,3,0.6,0,0,0.9\n")
    with pytest.raises(ScenarioError, match=r"haptic\.file: .*quaternion has length 1\.08"):
        device(motion="replay", file=str(file))


def test_formations_of_poses_are_reached_and_held():
    """Each formation is reached, with several elements rotating at once."""
    values = [(1.0, 0, 0, *Q_X, 0, 1.0, 0, *NONE), (2.0, 0, 0, *Q_Y, 0, 3.0, 0, *Q_Z)]
    motion = planner(Formation(values[0]), Formation(values[1], 1.0, 2.0), layout=TWO)
    for t, value in ((0.0, values[0]), (1.0, values[0]), (3.0, values[1]), (9.0, values[1])):
        np.testing.assert_allclose(TWO.difference(motion(t).position, np.array(value)), 0.0)
    assert motion(2.0).velocity.shape == (12,)


def rotating_hand(period: float = 0.001) -> RotatingHand:
    return RotatingHand(
        Hand(0.8, 6.0, 150.0, period, dim=3), Hand(0.01, 0.05, 3.0, period, dim=3), POSE
    )


def test_a_rotating_hand_follows_its_equation_of_motion():
    """I phi'' + d phi' + k phi = A(phi)' torque, by fine integration; translations as before."""
    hand, period = rotating_hand(), 0.001
    force = np.array([3.0, -1.0, 2.0, 1.2, -0.8, 1.5])
    hand.advance(force, 400)

    def rate(t, y):
        pull = so3.jacobian(y[:3]).T @ force[3:] - 0.05 * y[3:] - 3.0 * y[:3]
        return np.concatenate([y[3:], pull / 0.01])

    phi = solve_ivp(rate, (0.0, 400 * period), np.zeros(6), rtol=1e-10, atol=1e-12).y[:3, -1]
    found = hand.deflect(Reference.at_rest(POSE.identity, POSE), force)
    np.testing.assert_allclose(so3.log(found.position[3:]), phi, atol=2e-3)
    straight = Hand(0.8, 6.0, 150.0, period, dim=3)
    straight.advance(force[:3], 400)
    np.testing.assert_array_equal(found.position[:3], straight.deviation(force[:3]).position)


def test_without_force_a_rotating_hand_stays_on_the_intended_motion():
    """The device's motion equals the intended one, up to rounding."""
    hand = rotating_hand()
    hand.advance(np.zeros(6), 50)
    wanted = rotating_motions()["swing"](0.7)
    device_motion = hand.deflect(wanted, np.zeros(6))
    np.testing.assert_allclose(device_motion.position, wanted.position, atol=1e-15)
    np.testing.assert_allclose(device_motion.velocity, wanted.velocity, atol=1e-15)


def test_torque_deflects_a_rotating_device_and_a_reset_repeats_it():
    """A device with hand mass yields to the torque; a reset repeats this exactly."""
    keys = {"motion": "still", "centre": [0.0, 0.0, 0.0], "hand_mass": 1.0, "update_rate": 100.0}
    hand, torque = device(**keys), np.array([0.0, 0.0, 0.0, 0.5, 0.0, 0.0])
    first = [hand.sample(n / 100, torque).position for n in range(20)]
    again = [hand.sample(n / 100, torque).position for n in range(20)]
    np.testing.assert_array_equal(first, again)
    assert so3.log(first[-1][3:])[0] > 0.05
    np.testing.assert_array_equal(first[-1][:3], np.zeros(3))


POINTS = {"motion": "waypoints", "times": [0.0, 1.0], "points": [0.0] * 6}
SWING = {"amplitude": [1.0] * 3, "offset": [0.0] * 3}


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({}, "haptic.amplitude: found [2.0, 0.0], allowed: 3 numbers, one per coordinate"),
        (SWING | {"rotation": [1.0]}, "haptic.rotation: found [1.0], allowed: 3 numbers"),
        (SWING | {"orientation": [0.0, 0, 1]}, "haptic.orientation: found 3 numbers, allowed: 4"),
        (SWING | {"orientation": [0.0, 0, 1, 1]}, "haptic.orientation: found [0.0, 0.0, 1.0, 1."),
        (POINTS | {"orientations": NONE}, "haptic.orientations: found 4 numbers, allowed: 8 num"),
        (POINTS | {"orientations": NONE + (0.0,) * 4}, "a quaternion has length 0, should be 1"),
        (POINTS | {"points": [0.0] * 12}, "haptic.points: found 12 numbers, allowed: 6 numbers"),
    ],
)
def test_invalid_settings_are_rejected_by_key(values, message):
    """The error names the key, the value found and the allowed values."""
    with pytest.raises(ScenarioError) as caught:
        device(**values)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ((0.0,) * 6, "planner.a.value: found [0.0, 0.0, 0.0, 0.0, 0.0, 0.0], allowed: 7 numbers"),
        ((0.0,) * 7, "a quaternion has length 0, should be 1"),
    ],
)
def test_invalid_poses_of_formations_are_rejected(value, message):
    """A formation has seven numbers per element, the last four a unit quaternion."""
    with pytest.raises(ScenarioError) as caught:
        planner(Formation(value))
    assert message in str(caught.value)


def test_a_subtask_without_translations_has_no_circle():
    """A circle is in the plane of two coordinates."""
    with pytest.raises(ScenarioError, match=r"haptic\.motion: found circle, .* has 0"):
        device(TURN, motion="circle")
    rotation = motions.with_rotation(
        motions.still([]), motions.swing([0.1, 0.2, 0.3], 1.0, [0.0] * 3), NONE, TURN
    )
    assert rotation(0.3).position.shape == (4,)
