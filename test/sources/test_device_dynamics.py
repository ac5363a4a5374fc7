# SPDX-License-Identifier: Apache-2.0
"""The device's own dynamics, its workspace and limits, and an operator who notices late."""

from typing import Any

import numpy as np
import pytest

from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import load
from noninteract_ros.sources.human.haptic_device import HapticDevice, HapticSettings
from noninteract_ros.subtasks.layout import Layout

GRIP = {"hand_mass": 0.6, "hand_damping": 15.0, "hand_stiffness": 300.0}
STILL = {"motion": "still", "centre": [0.0, 0.0]}


def device(**values: Any) -> HapticDevice:
    """A device as a scenario file gives it."""
    return HapticDevice(load(HapticSettings, GRIP | values, "haptic"), Layout.scalars(2))


def settled(found: HapticDevice, force: list[float], ticks: int = 2000) -> np.ndarray:
    """Where a constant force brings it in the end."""
    for tick in range(ticks):
        motion = found.sample(tick / 1000.0, np.array(force))
        assert motion is not None
    return motion.position


def test_defaults_leave_the_hand_as_it_was() -> None:
    """Without the new keys the device is the hand alone, to the bit."""
    plain, spelt = device(**STILL), device(**STILL, device_mass=0.0, reaction_delay=0.5)
    for tick in range(100):
        force = np.array([np.sin(0.1 * tick), 1.0])
        a, b = plain.sample(tick / 1e3, force), spelt.sample(tick / 1e3, force)
        assert a is not None
        assert b is not None
        np.testing.assert_array_equal(a.position, b.position)


def test_the_grip_has_to_move_the_device() -> None:
    """Swung at w, hand and device follow (m_d w^2 - j b_d w) x_i / (k - m w^2 + j d w) apart."""
    w, m_d, b_d = 6.0, 0.4, 3.0
    found = device(
        motion="paper",
        amplitude=[0.1, 0.0],
        offset=[0.0, 0.0],
        frequency=w,
        device_mass=m_d,
        device_damping=b_d,
    )
    gap = []
    t = np.arange(4000) / 1000.0
    for now in t:
        motion = found.sample(now)
        assert motion is not None
        gap.append(motion.position[0] - 0.1 * np.sin(w * now))
    mass, damping = GRIP["hand_mass"] + m_d, GRIP["hand_damping"] + b_d
    response = (m_d * w**2 - 1j * b_d * w) / (
        GRIP["hand_stiffness"] - mass * w**2 + 1j * damping * w
    )
    # What the device resists is held over a tick, which is a delay of half a tick.
    expected = 0.1 * np.imag(response * np.exp(1j * w * (t - 0.0005)))
    np.testing.assert_allclose(gap[2500:], expected[2500:], atol=5e-7)
    assert abs(expected).max() > 2e-3


def test_motors_give_no_more_than_their_limit() -> None:
    """A force of 50 N acts as 6 N in its direction."""
    place = settled(device(**STILL, force_limit=6.0), [30.0, -40.0])
    np.testing.assert_allclose(place, [3.6 / 300.0, -4.8 / 300.0], rtol=1e-6)


def test_the_workspace_ends_in_springs() -> None:
    """Beyond half an edge from the centre grip and end share the force, before it not."""
    keys = {
        "workspace": [0.02, 1.0],
        "workspace_centre": [0.01, 0.0],
        "workspace_stiffness": 700.0,
    }
    place = settled(device(**STILL, **keys), [10.0, 10.0])
    # 10 N = 300 x + 700 (x - 0.02); across it the box is wide.
    np.testing.assert_allclose(place, [0.024, 10.0 / 300.0], rtol=1e-6)


def test_an_operator_who_notices_corrects_after_the_delay() -> None:
    """Up to the delay the deviation is the grip's, in the end grip and correction share it."""
    slow = device(**STILL, reaction_stiffness=60.0, reaction_delay=0.2)
    dull = device(**STILL)
    push = np.array([6.0, 0.0])
    same = []
    for tick in range(400):
        a, b = slow.sample(tick / 1e3, push), dull.sample(tick / 1e3, push)
        assert a is not None
        assert b is not None
        same.append(bool((a.position == b.position).all()))
    assert all(same[:200])
    assert not any(same[210:])
    np.testing.assert_allclose(settled(slow, [6.0, 0.0], 4000), [6.0 / 360.0, 0.0], rtol=1e-4)


def test_a_workspace_of_another_size_is_refused() -> None:
    """The error names the key and how many numbers it takes."""
    with pytest.raises(ScenarioError, match=r"haptic\.workspace: found \[1\.0\].*2 numbers"):
        device(**STILL, workspace=[1.0])


def test_what_concerns_translations_is_refused_where_there_are_none() -> None:
    """A mass of the device says nothing about turning; its key is named."""
    turn = Layout((0,), (True,))
    values = {**GRIP, "motion": "still", "centre": [], "device_mass": 0.2}
    with pytest.raises(ScenarioError, match=r"haptic\.device_mass: found 0\.2.* only rotates"):
        HapticDevice(load(HapticSettings, values, "haptic"), turn)
