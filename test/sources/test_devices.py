# SPDX-License-Identifier: Apache-2.0
"""Mapping of axes, buttons and keys."""

import math
from typing import Any

import numpy as np
import pytest
from repository import ROOT

from noninteract_ros.errors import InputError, ScenarioError
from noninteract_ros.scenario.files import read_parameters
from noninteract_ros.schema import load
from noninteract_ros.sources.human.input_settings import JoySettings, KeyboardSettings
from noninteract_ros.sources.human.joy_mapping import JoyMapping
from noninteract_ros.sources.human.key_state import DIRECTIONS, KeyState


def mapping(**keys: Any) -> JoyMapping:
    """Build a mapping from keys of a file."""
    return JoyMapping(load(JoySettings, keys, "joy"))


def shipped(name: str) -> JoyMapping:
    """Load one of the package's mapping files."""
    return mapping(**read_parameters(ROOT / "config" / "devices" / f"{name}.yaml")["joy"])


def test_directions_are_sums_of_axes_and_buttons() -> None:
    """Sums have signs, several terms and pairs of buttons, and are limited to 1."""
    found = mapping(x="-axis1", y="axis0+axis2", z="button1 - button0", deadzone=0.0, exponent=1.0)
    stick, _ = found.read([0.25, 0.5, 0.5], [0, 1])
    np.testing.assert_allclose(stick, [-0.5, 0.75, 1.0, 0.0, 0.0, 0.0])
    stick, _ = found.read([0.8, 0.0, 0.8], [1, 1])
    np.testing.assert_allclose(stick, [0.0, 1.0, 0.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("text", ["axis", "1", "axis1 axis2", "axis1-", "stick1", "axis1*2"])
def test_an_invalid_sum_is_rejected(text: str) -> None:
    """The error names the key and shows an example."""
    with pytest.raises(ScenarioError, match=r"joy\.yaw: .*button5-button4"):
        mapping(yaw=text)


def test_the_enable_button_holds_and_the_slow_button_reduces() -> None:
    """The dead-man's switch is the button's state; an omitted button is not pressed."""
    found = mapping(enable_button=2, slow_button=1, slow_factor=0.5, deadzone=0.0, exponent=1.0)
    for buttons, held in (([0, 0, 1], True), ([0, 0, 0], False), ([1], False), ([], False)):
        assert found.read([0.0, 1.0], buttons)[1] is held
    np.testing.assert_allclose(found.read([0.0, 1.0], [0, 1, 1])[0][0], 0.5)


@pytest.mark.parametrize("axes", [[0.0], [], [0.0, math.nan], [math.inf, 0.0]])
def test_a_message_of_another_device_is_rejected(axes: list[float]) -> None:
    """Too few axes and numbers that are not finite are rejected."""
    with pytest.raises(InputError, match=r"axes|finite"):
        mapping().read(axes, [0] * 11)


def test_the_gamepad_moves_along_its_sticks() -> None:
    """Left stick: forward and left; right stick: up and rotation to the left."""
    found = shipped("joy_gamepad")
    buttons = [0] * 21
    buttons[9] = 1
    for axis, direction in ((1, 0), (0, 1), (3, 2), (2, 5)):
        axes = [0.0] * 6
        axes[axis] = 1.0
        stick, held = found.read(axes, buttons)
        assert held
        np.testing.assert_allclose(stick, np.eye(6)[direction])
    assert not found.read([0.0] * 6, [0] * 21)[1]


def test_the_space_mouse_is_held_while_it_is_deflected() -> None:
    """Its axes are in order; at rest and within the dead zone it is released."""
    found = shipped("joy_spacenav")
    for axis in range(6):
        stick, held = found.read(np.eye(6)[axis].tolist(), [])
        assert held
        np.testing.assert_allclose(stick, np.eye(6)[axis])
    assert not found.read([0.05, -0.05, 0.0, 0.0, 0.0, 0.0], [])[1]


def test_keys_are_held_for_a_while() -> None:
    """Each direction has two keys, which count as held for `key_hold`."""
    assert sorted(DIRECTIONS.values()) == sorted((i, s) for i in range(6) for s in (-1.0, 1.0))
    keys = KeyState(KeyboardSettings(key_hold=0.6))
    keys.press("w", 10.0)
    keys.press("d", 10.5)
    np.testing.assert_allclose(keys.stick(10.6), [0.5, -0.5, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(keys.stick(10.7), [0.0, -0.5, 0.0, 0.0, 0.0, 0.0])
    keys.press("a", 10.8)
    np.testing.assert_allclose(keys.stick(10.8)[1], 0.5)


@pytest.mark.parametrize("key", [" ", "x", "\x1b"])
def test_space_and_unknown_keys_stop(key: str) -> None:
    """Any unassigned key releases all directions."""
    keys = KeyState(KeyboardSettings())
    keys.press("w", 0.0)
    keys.press(key, 0.1)
    assert not keys.stick(0.1).any()


def test_speed_goes_up_and_down_within_bounds() -> None:
    """The speed does not exceed full speed."""
    keys = KeyState(KeyboardSettings(step=1.25))
    keys.press("-", 0.0)
    assert keys.speed == pytest.approx(0.4)
    for _ in range(20):
        keys.press("+", 0.0)
    assert keys.speed == 1.0
