# SPDX-License-Identifier: Apache-2.0
"""Emulated haptic device: samples, feedback and rejected settings."""

import math

import numpy as np
import pytest

from noninteract_ros.errors import InputError, ScenarioError
from noninteract_ros.schema import load
from noninteract_ros.sources.human.hand import Hand
from noninteract_ros.sources.human.haptic_device import HapticDevice, HapticSettings
from noninteract_ros.sources.human.motion import swing
from noninteract_ros.subtasks.layout import Layout

PUSH = np.array([5.0, -2.0])


def device(dim=2, **values):
    """Build a device from keys of a scenario file."""
    return HapticDevice(load(HapticSettings, values, "haptic"), Layout.scalars(dim))


def test_the_papers_operator_is_the_default():
    """The defaults are the paper's motion in absolute time, without samples before 4 s."""
    hand = device(start_time=4.0)
    assert hand.sample(3.999) is None
    assert hand.next_sample(0.0) == 4.0
    for t in (4.0, 4.001, 11.7):
        np.testing.assert_allclose(hand.sample(t).position, [2 * np.sin(0.79 * t), 1], rtol=1e-14)


def test_other_motions_count_from_the_start(tmp_path):
    """Circle, waypoints and replay start at `start_time`."""
    file = tmp_path / "hand.csv"
    file.write_text("t,x,y\n100,7,8\n101,9,10\n")
    begins = {
        "circle": ({"centre": [1.0, 2.0], "radius": 0.5}, [1.5, 2.0]),
        "waypoints": ({"points": [1.0, 2.0, 3.0, 4.0], "times": [0.0, 1.0]}, [1.0, 2.0]),
        "replay": ({"file": str(file)}, [7.0, 8.0]),
        "still": ({"centre": [3.0, 3.0]}, [3.0, 3.0]),
    }
    for motion, (keys, expected) in begins.items():
        hand = device(motion=motion, start_time=2.0, **keys)
        np.testing.assert_allclose(hand.sample(2.0).position, expected, rtol=1e-15)


def test_samples_exist_between_start_and_stop_except_in_dropouts():
    """Samples exist exactly inside the windows, and next_sample agrees."""
    hand = device(
        start_time=0.1,
        stop_time=0.9,
        dropout_times=[0.0, 0.2, 0.5, 0.6, 0.8, 2.0],
        update_rate=100,
    )
    sampled = [n for n in range(120) if hand.sample(n / 100) is not None]
    assert sampled == [*range(20, 50), *range(60, 80)]
    assert hand.next_sample(0.0) == 0.2
    assert hand.next_sample(0.3) == 0.31
    assert hand.next_sample(0.49) == 0.6
    assert hand.next_sample(0.79) == math.inf
    assert hand.next_update(0.79) == 0.8


def test_the_feedback_deflects_the_device():
    """Samples are those of the hand impedance about the intended motion."""
    hand = device(hand_mass=1.2, hand_damping=8.0, hand_stiffness=200.0, update_rate=100.0)
    expected = Hand(1.2, 8.0, 200.0, 0.01, dim=2)
    for n in range(30):
        force = PUSH * n
        if n > 0:
            expected.advance(force, 1)
        wanted = expected.deflect(swing([2.0, 0.0], 0.79, [0.0, 1.0])(n / 100), force)
        found = hand.sample(n / 100, force)
        for name in ("position", "velocity", "acceleration"):
            np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name))


def test_feedback_does_not_deflect_a_rigid_hand():
    """Without a hand mass the samples are the intended motion under any feedback."""
    hand = device()
    np.testing.assert_array_equal(hand.sample(1.0, PUSH).position, hand.sample(1.0).position)


def test_a_repeated_sample_is_the_same():
    """A repeated sample time does not advance the hand."""
    hand = device(hand_mass=1.0)
    hand.sample(0.0, PUSH)
    first, again = hand.sample(0.01, PUSH), hand.sample(0.01, PUSH)
    np.testing.assert_array_equal(first.position, again.position)
    np.testing.assert_array_equal(first.acceleration, again.acceleration)


def test_no_feedback_acts_during_a_dropout():
    """After a long dropout the device is back on the intended motion."""
    hand = device(hand_mass=1.0, dropout_times=[0.5, 5.0])
    steady = device()
    for n in range(500):
        hand.sample(n / 1000, PUSH)
    pushed = np.abs(hand.sample(0.499, PUSH).position - steady.sample(0.499).position)
    assert pushed.max() > 0.005
    assert hand.sample(0.5, PUSH) is None
    np.testing.assert_allclose(
        hand.sample(5.0, PUSH).position, steady.sample(5.0).position, atol=1e-12
    )


def test_a_run_that_is_reset_gives_the_same_samples():
    """An earlier sample time resets the hand exactly."""
    hand = device(hand_mass=1.0, tremor_amplitude=0.01)
    first, second = ([hand.sample(n / 1000, PUSH).position for n in range(50)] for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_tremor_is_part_of_the_intended_motion():
    """With tremor the position deviates from the steady motion by at most the amplitude."""
    off = device(tremor_amplitude=0.01).sample(3.0).position - device().sample(3.0).position
    assert 0.0 < np.abs(off).max() <= 0.01


@pytest.mark.parametrize("feedback", [np.zeros(3), np.zeros((2, 1)), np.array([np.nan, 0.0])])
def test_invalid_feedback_is_rejected(feedback):
    """A wrong shape or NaN is an input error and does not change the hand."""
    hand, reference = device(hand_mass=1.0), device(hand_mass=1.0)
    for one in (hand, reference):
        one.sample(0.0, PUSH)
    with pytest.raises(InputError, match="feedback"):
        hand.sample(0.001, feedback)
    np.testing.assert_array_equal(
        hand.sample(0.001, PUSH).position, reference.sample(0.001, PUSH).position
    )


@pytest.mark.parametrize(
    ("dim", "values", "message"),
    [
        (3, {}, "haptic.amplitude: found [2.0, 0.0], allowed: 3 numbers, one per coordinate"),
        (2, {"offset": [1.0]}, "haptic.offset: found [1.0], allowed: 2 numbers"),
        (1, {"motion": "circle", "centre": [0.0]}, "haptic.motion: found circle, allowed: a sub"),
        (2, {"motion": "circle"}, "haptic.centre: found [], allowed: 2 numbers"),
        (2, {"motion": "still", "centre": [1.0]}, "haptic.centre: found [1.0], allowed: 2"),
        (2, {"motion": "spiral"}, "haptic.motion: found 'spiral', allowed: "),
        (2, {"motion": "waypoints"}, "haptic.times: found [], allowed: 2 or more increasing"),
        (
            2,
            {"motion": "waypoints", "times": [0.0, 1.0], "points": [1.0, 2.0, 3.0]},
            "haptic.points: found 3 numbers, allowed: 4 numbers (2 times, 2 coordinates each)",
        ),
        (
            1,
            {"motion": "waypoints", "times": [1.0, 1.0], "points": [1.0, 2.0]},
            "haptic.times: found [1.0, 1.0], allowed: 2 or more increasing times",
        ),
        (2, {"motion": "replay"}, "haptic.file: found nothing, allowed: a CSV file"),
        (2, {"motion": "replay", "file": "no/such.csv"}, "No such file"),
        (2, {"start_time": 2.0, "stop_time": 1.0}, "haptic.stop_time: found 1.0, allowed: 0, or"),
        (2, {"dropout_times": [1.0]}, "haptic.dropout_times: found [1.0], allowed: pairs"),
        (2, {"dropout_times": [1.0, 0.5]}, "haptic.dropout_times: found [1.0, 0.5]"),
        (2, {"dropout_times": [0.0, 2.0, 1.0, 3.0]}, "haptic.dropout_times: found [0.0, 2.0, 1"),
        (2, {"update_rate": 0.0}, "haptic.update_rate: found 0.0, allowed: a number > 0"),
        (2, {"hand_mass": -1.0}, "haptic.hand_mass: found -1.0"),
    ],
)
def test_invalid_settings_are_rejected_by_key(dim, values, message):
    """The error names the key, the value found and the allowed values."""
    with pytest.raises(ScenarioError) as caught:
        device(dim, **values)
    assert message in str(caught.value)
    assert caught.value.key.startswith("haptic.")
