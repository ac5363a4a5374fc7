# SPDX-License-Identifier: Apache-2.0
"""Nodes of input devices, with the messages of real drivers and a simulated team."""

import os
import pty
import termios
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TwistStamped
from harness import Ros, merged, paper
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_sensor_data
from repository import ROOT
from sensor_msgs.msg import Joy
from std_msgs.msg import Bool
from waiting import DEADLINE, until

from noninteract_ros.errors import ScenarioError
from noninteract_ros.nodes.sources.joy_operator import JoyOperator
from noninteract_ros.nodes.sources.keyboard_operator import KeyboardOperator
from noninteract_ros.nodes.sources.pose_operator import PoseOperator
from noninteract_ros.scenario.files import read_parameters

ENABLE = 9
FORWARD = [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]
REST = [0.0] * 6


class OperatorHarness:
    """Team in wall time without a human, and the node of one input device."""

    def __init__(self, ros: Ros, make: Callable[..., Any], **changes: Any) -> None:
        self.ros = ros
        # A long timeout, since a slow machine may delay the test.
        patient = {"operator": {"hold_timeout": 1.0}}
        values = paper(haptic=None, object=None, lockstep=False, **(patient | changes))
        values["cooperative"]["timeout"] = 0.3
        self.stack = ros.stack(values).start()
        self.monitor = self.stack.monitor
        overrides = [Parameter(k, value=v) for k, v in _flat(self.stack.values)]
        self.node = ros.add_node(make(context=ros.context, parameter_overrides=overrides))
        self.commands: list[tuple[float, Any]] = []
        for kind, topic in ((TwistStamped, "target_twist"), (PoseStamped, "target_pose")):
            ros.probe.create_subscription(
                kind, f"cooperative/human/{topic}", self._on_command, 100
            )
        until(lambda: self.node.desired() is not None, "the desired motion")

    def _on_command(self, message: Any) -> None:
        self.commands.append((time.monotonic(), message))

    def rates(self) -> np.ndarray:
        """Return the published rates, shape (n, 2)."""
        twists = [item.twist.linear for _, item in list(self.commands) if hasattr(item, "twist")]
        return np.array([[item.x, item.y] for item in twists]).reshape(-1, 2)

    def centre(self) -> np.ndarray:
        """Return the centre of the team, shape (2,) [m]."""
        q = self.monitor.newest().position
        assert q is not None
        return 0.5 * (q[:2] + q[2:])

    def speed(self) -> float:
        """Return the speed of the desired motion [m/s]."""
        desired = self.node.desired()
        return float(np.linalg.norm(desired.velocity)) if desired else 0.0

    def publish(self, publisher: Any, message: Any, rate: float, done: Callable[[], Any]) -> None:
        """Publish at a rate [Hz] until a condition is true, as a driver does."""
        end = time.monotonic() + DEADLINE
        while not done():
            assert time.monotonic() < end, "no effect before the deadline"
            publisher.publish(message)
            time.sleep(1.0 / rate)

    def expect_no_command(self) -> None:
        """Check that nothing is published after all messages so far are processed."""
        self.ros.drain()
        count = len(self.commands)
        self.monitor.wait_for_timers(self.node.get_name())
        self.ros.drain()
        assert len(self.commands) == count

    def wait_for_release(self) -> None:
        """Wait until the device is released and the team is at rest without further commands."""
        until(lambda: self.speed() < 1e-3, "rest")
        until(lambda: self.node._releases_left == 0, "the zero rates of the release")
        self.expect_no_command()


def _flat(values: dict[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", value


def mapping(name: str) -> dict[str, Any]:
    """Read a mapping file of the package."""
    return read_parameters(ROOT / "config" / "devices" / f"{name}.yaml")


def joy(axes: list[float], pressed: tuple[int, ...] = (), count: int = 21) -> Joy:
    """Return a message as published by drivers."""
    message = Joy(axes=axes, buttons=[int(n in pressed) for n in range(count)])
    message.header.frame_id = "joy"
    return message


def test_a_gamepad_commands_while_its_button_is_held(ros: Ros) -> None:
    """Autorepeat at 20 Hz: motion while held, rest on release, then no messages."""
    setup = OperatorHarness(ros, JoyOperator, **mapping("joy_gamepad"))
    driver = ros.probe.create_publisher(Joy, "/joy", 10)
    ros.wait_for_subscribers(driver)
    start = setup.centre()
    for _ in range(10):  # Nobody holds what a driver reports before the first event of an axis.
        driver.publish(joy(FORWARD, (ENABLE,)))
    setup.expect_no_command()
    assert not setup.commands
    driver.publish(joy(REST))
    for _ in range(10):  # The stick alone has no effect.
        driver.publish(joy(FORWARD))
    setup.expect_no_command()
    assert not setup.commands
    held = joy(FORWARD, (ENABLE,))
    setup.publish(driver, held, 20.0, lambda: setup.centre()[0] > start[0] + 0.05)
    rates = setup.rates()
    np.testing.assert_allclose(rates, np.tile([0.2, 0.0], (len(rates), 1)))
    driver.publish(joy(FORWARD))
    setup.wait_for_release()
    assert not setup.rates()[-1].any()
    assert abs(setup.centre()[1] - start[1]) < 0.05


def test_a_disconnected_gamepad_is_released_until_its_button_is_pressed_again(ros: Ros) -> None:
    """Lost messages stop the team; the button must be released before it has an effect again."""
    setup = OperatorHarness(ros, JoyOperator, **mapping("joy_gamepad"))
    driver = ros.probe.create_publisher(Joy, "/joy", 10)
    ros.wait_for_subscribers(driver)
    held = joy(FORWARD, (ENABLE,))
    driver.publish(joy(REST))
    setup.publish(driver, held, 20.0, lambda: setup.speed() > 0.15)
    setup.wait_for_release()
    for _ in range(10):
        driver.publish(held)
    setup.expect_no_command()
    driver.publish(joy(REST))
    setup.publish(driver, held, 20.0, lambda: setup.speed() > 0.15)


@pytest.mark.parametrize("rate", [60.0, 500.0], ids=["at the rate of its events", "in a burst"])
def test_a_space_mouse_commands_while_it_is_deflected(ros: Ros, rate: float) -> None:
    """It has no buttons, and publishes zeros after the last motion."""
    setup = OperatorHarness(ros, JoyOperator, **mapping("joy_spacenav"))
    driver = ros.probe.create_publisher(Joy, "/spacenav/joy", 10)
    ros.wait_for_subscribers(driver)
    driver.publish(joy(REST, count=0))
    deflected = joy([0.0, -0.8, 0.3, 0.0, 0.0, 0.0], count=0)
    setup.publish(driver, deflected, rate, lambda: setup.speed() > 0.1)
    assert (setup.rates()[1:, 1] < 0.0).all()
    driver.publish(joy(REST, count=0))
    setup.wait_for_release()


def test_an_invalid_message_is_rejected(ros: Ros) -> None:
    """A message with two axes is of another device; diagnostics have the reason."""
    setup = OperatorHarness(ros, JoyOperator, **mapping("joy_gamepad"))
    driver = ros.probe.create_publisher(Joy, "/joy", 10)
    ros.wait_for_subscribers(driver)
    driver.publish(joy([1.0, 1.0], (ENABLE,)))
    until(
        lambda: "needs 4" in setup.monitor.value("joy_operator", "last rejection"), "the rejection"
    )
    setup.expect_no_command()
    assert not setup.commands


def pose(x: float, y: float, frame: str = "phantom_base") -> PoseStamped:
    """Return a pose as published by the driver of a haptic device, in its own frame."""
    message = PoseStamped()
    message.header.frame_id = frame
    message.pose.position.x, message.pose.position.y = x, y
    message.pose.orientation.w = 1.0
    return message


def test_a_tracker_moves_the_team_from_where_its_clutch_is_closed(ros: Ros) -> None:
    """Device at 3 m, team at 0: clutching moves nothing, and 6 cm of motion move it by 6 cm."""
    setup = OperatorHarness(ros, PoseOperator)
    driver = ros.probe.create_publisher(PoseStamped, "device/pose", 10)
    clutch = ros.probe.create_publisher(Bool, "device/clutch", 10)
    ros.wait_for_subscribers(driver, clutch)
    start = setup.centre()
    for _ in range(20):
        driver.publish(pose(3.0, 3.0))
    setup.expect_no_command()
    assert not setup.commands
    clutch.publish(Bool(data=True))
    setup.publish(driver, pose(3.0, 3.0), 100.0, lambda: len(setup.commands) > 10)
    first = setup.commands[0][1].pose.position
    np.testing.assert_allclose([first.x, first.y], start, atol=5e-3)
    assert setup.speed() < 1e-3
    for k in range(1, 13):  # Steps below the largest jump, in 0.12 s.
        driver.publish(pose(3.0 + 0.005 * k, 3.0))
        time.sleep(0.01)
    goal = start + np.array([0.06, 0.0])

    def reached() -> bool:
        return bool(np.abs(setup.centre() - goal).max() < 3e-3)

    setup.publish(driver, pose(3.06, 3.0), 100.0, reached)
    clutch.publish(Bool(data=False))
    driver.publish(pose(3.06, 3.0))
    setup.wait_for_release()
    # Clutching elsewhere does not move the team.
    clutch.publish(Bool(data=True))
    count = len(setup.commands)
    setup.publish(driver, pose(2.0, 1.0), 100.0, lambda: len(setup.commands) > count + 10)
    assert np.abs(setup.centre() - goal).max() < 5e-3


@pytest.mark.parametrize("turns", [False, True], ids=["position", "orientation"])
def test_a_jump_of_the_tracker_releases_the_clutch(ros: Ros, turns: bool) -> None:
    """A pose half a metre or half a turn away in one message releases the clutch.

    The driver is a best-effort publisher.
    """
    away = pose(0.0, 0.0) if turns else pose(0.5, 0.0)
    if turns:
        away.pose.orientation.x, away.pose.orientation.w = 1.0, 0.0
    setup = OperatorHarness(ros, PoseOperator)
    driver = ros.probe.create_publisher(PoseStamped, "device/pose", qos_profile_sensor_data)
    clutch = ros.probe.create_publisher(Bool, "device/clutch", 10)
    ros.wait_for_subscribers(driver, clutch)
    clutch.publish(Bool(data=True))
    setup.publish(driver, pose(0.0, 0.0), 100.0, lambda: len(setup.commands) > 5)
    start = setup.centre()
    setup.publish(driver, away, 100.0, lambda: setup.node._rejected)
    for _ in range(20):
        driver.publish(away)
    setup.wait_for_release()
    assert np.abs(setup.centre() - start).max() < 5e-3


def test_a_clutch_button_is_released_when_its_topic_times_out(ros: Ros) -> None:
    """Autorepeat at 20 Hz; a disconnected gamepad releases the clutch while poses go on."""
    setup = OperatorHarness(ros, PoseOperator, tracker={"joy_topic": "/joy", "clutch_button": 2})
    driver = ros.probe.create_publisher(PoseStamped, "device/pose", 10)
    gamepad = ros.probe.create_publisher(Joy, "/joy", 10)
    ros.wait_for_subscribers(driver, gamepad)
    start, moved = setup.centre(), 0.0

    def held(step: float, done: Callable[[], Any]) -> None:
        """Move at 0.5 m/s at most, with the button in every fifth message."""
        nonlocal moved
        for k in range(round(DEADLINE / 0.01)):
            if done():
                return
            moved = min(moved + step, 0.06)
            driver.publish(pose(3.0 + moved, 3.0))
            if k % 5 == 0:
                gamepad.publish(joy(REST, (2,)))
            time.sleep(0.01)
        raise AssertionError("no effect before the deadline")

    held(0.0, lambda: len(setup.commands) > 10)
    held(5e-3, lambda: abs(setup.centre()[0] - start[0] - 0.06) < 3e-3)
    setup.publish(driver, pose(3.06, 3.0), 100.0, lambda: setup.node._releases_left == 0)
    ros.drain()
    count = len(setup.commands)
    gamepad.publish(joy(REST, (2,)))  # Connected again: the button must be pressed again.
    setup.publish(driver, pose(3.06, 3.0), 100.0, setup.monitor.has_new_status("pose_operator"))
    setup.publish(driver, pose(3.06, 3.0), 100.0, setup.monitor.has_new_status("pose_operator"))
    ros.drain()
    assert len(setup.commands) == count
    assert not setup.node.input.clutched


class Keyboard:
    """Node of the keyboard on a pseudo-terminal."""

    def __init__(self) -> None:
        self.keyboard, self.terminal = pty.openpty()

    def make(self, **kwargs: Any) -> KeyboardOperator:
        """Create the node."""
        return KeyboardOperator(terminal=self.terminal, **kwargs)

    def press(self, keys: str) -> None:
        """Write keys to the terminal."""
        os.write(self.keyboard, keys.encode())


def test_a_key_commands_while_it_repeats_and_space_stops(ros: Ros) -> None:
    """A terminal repeats a key after half a second, then 30 times a second."""
    keyboard = Keyboard()
    before = termios.tcgetattr(keyboard.terminal)
    setup = OperatorHarness(ros, keyboard.make)
    keyboard.press("d")
    time.sleep(0.5)  # Delay before the first repetition.
    end = time.monotonic() + DEADLINE
    while setup.centre()[1] > -0.05:
        assert time.monotonic() < end, "no effect before the deadline"
        keyboard.press("d")
        time.sleep(0.033)
    rates = setup.rates()
    np.testing.assert_allclose(rates, np.tile([0.0, -0.1], (len(rates), 1)))
    keyboard.press(" ")
    until(lambda: not setup.node.dead_man.is_held(time.monotonic()), "the stop")
    setup.wait_for_release()
    setup.ros.remove(setup.node)
    assert termios.tcgetattr(keyboard.terminal)[3] == before[3]  # Echo and line mode are restored.


def test_a_keyboard_needs_a_terminal(ros: Ros) -> None:
    """A pipe is an error."""
    read, write = os.pipe()
    overrides = [Parameter(k, value=v) for k, v in _flat(merged(paper(), {}))]
    with pytest.raises(ScenarioError, match=r"\(terminal\).*allowed: a terminal"):
        KeyboardOperator(terminal=read, context=ros.context, parameter_overrides=overrides)
    os.close(read)
    os.close(write)
