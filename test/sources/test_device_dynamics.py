# SPDX-License-Identifier: Apache-2.0
"""Dynamics, workspace and limits of the device, and the operator's delayed correction."""

from typing import Any

import numpy as np
import pytest

from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import load
from noninteract_ros.sources.human.haptic_device import HapticDevice, HapticSettings
from noninteract_ros.subtasks.layout import Layout

HAND = {"hand_mass": 0.6, "hand_damping": 15.0, "hand_stiffness": 300.0}
STILL = {"motion": "still", "centre": [0.0, 0.0]}


def device(**values: Any) -> HapticDevice:
    """Build a device from keys of a scenario file."""
    return HapticDevice(load(HapticSettings, HAND | values, "haptic"), Layout.scalars(2))


def settled(found: HapticDevice, force: list[float], ticks: int = 2000) -> np.ndarray:
    """Return the final position under a constant force."""
    for tick in range(ticks):
        motion = found.sample(tick / 1000.0, np.array(force))
        assert motion is not None
    return motion.position


def test_default_device_dynamics_do_not_change_the_hand() -> None:
    """With the default keys the device is exactly the hand alone."""
    plain, explicit = device(**STILL), device(**STILL, device_mass=0.0, reaction_delay=0.5)
    for tick in range(100):
        force = np.array([np.sin(0.1 * tick), 1.0])
        a, b = plain.sample(tick / 1e3, force), explicit.sample(tick / 1e3, force)
        assert a is not None
        assert b is not None
        np.testing.assert_array_equal(a.position, b.position)


def test_the_hand_moves_the_mass_and_damping_of_the_device() -> None:
    """At frequency w the deviation is (m_d w^2 - j b_d w) x_i / (k - m w^2 + j d w)."""
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
    mass, damping = HAND["hand_mass"] + m_d, HAND["hand_damping"] + b_d
    response = (m_d * w**2 - 1j * b_d * w) / (
        HAND["hand_stiffness"] - mass * w**2 + 1j * damping * w
    )
    # The device force is held over a tick, which is a delay of half a tick.
    expected = 0.1 * np.imag(response * np.exp(1j * w * (t - 0.0005)))
    np.testing.assert_allclose(gap[2500:], expected[2500:], atol=5e-7)
    assert abs(expected).max() > 2e-3


def test_the_motor_force_is_limited() -> None:
    """A force of 50 N acts as 6 N in its direction."""
    place = settled(device(**STILL, force_limit=6.0), [30.0, -40.0])
    np.testing.assert_allclose(place, [3.6 / 300.0, -4.8 / 300.0], rtol=1e-6)


def test_the_workspace_boundary_is_a_spring() -> None:
    """Beyond half an edge length from the centre, hand and boundary share the force."""
    keys = {
        "workspace": [0.02, 1.0],
        "workspace_centre": [0.01, 0.0],
        "workspace_stiffness": 700.0,
    }
    place = settled(device(**STILL, **keys), [10.0, 10.0])
    # 10 N = 300 x + 700 (x - 0.02); in the other direction the box is wide.
    np.testing.assert_allclose(place, [0.024, 10.0 / 300.0], rtol=1e-6)


def test_the_operator_corrects_after_the_reaction_delay() -> None:
    """Until the delay the hand alone resists, finally hand and correction share the force."""
    active = device(**STILL, reaction_stiffness=60.0, reaction_delay=0.2)
    passive = device(**STILL)
    push = np.array([6.0, 0.0])
    same = []
    for tick in range(400):
        a, b = active.sample(tick / 1e3, push), passive.sample(tick / 1e3, push)
        assert a is not None
        assert b is not None
        same.append(bool((a.position == b.position).all()))
    assert all(same[:200])
    assert not any(same[210:])
    np.testing.assert_allclose(settled(active, [6.0, 0.0], 4000), [6.0 / 360.0, 0.0], rtol=1e-4)


def test_a_workspace_of_the_wrong_size_is_rejected() -> None:
    """The error names the key and the allowed count of numbers."""
    with pytest.raises(ScenarioError, match=r"haptic\.workspace: found \[1\.0\].*2 numbers"):
        device(**STILL, workspace=[1.0])


def test_translational_keys_are_rejected_without_translations() -> None:
    """A device mass does not apply to a subtask with rotations only; the error names its key."""
    rotation = Layout((0,), (True,))
    values = {**HAND, "motion": "still", "centre": [], "device_mass": 0.2}
    with pytest.raises(ScenarioError, match=r"haptic\.device_mass: found 0\.2.* only rotates"):
        HapticDevice(load(HapticSettings, values, "haptic"), rotation)
