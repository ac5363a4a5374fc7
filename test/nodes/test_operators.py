# SPDX-License-Identifier: Apache-2.0
"""Programs for people's devices, fed with what the real drivers publish, in front of a team."""

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
    """A team in wall time without a human, one operator's program and the device's driver."""

    def __init__(self, ros: Ros, make: Callable[..., Any], **changes: Any) -> None:
        self.ros = ros
        # Patient, for the test may be kept waiting; what is tested does not depend on it.
        patient = {"operator": {"hold_timeout": 1.0}}
        values = paper(haptic=None, object=None, lockstep=False, **(patient | changes))
        values["cooperative"]["timeout"] = 0.3
        self.stack = ros.stack(values).start()
        self.monitor = self.stack.monitor
        overrides = [Parameter(k, value=v) for k, v in _flat(self.stack.values)]
        self.node = ros.add_node(make(context=ros.context, parameter_overrides=overrides))
        self.said: list[tuple[float, Any]] = []
        for kind, topic in ((TwistStamped, "target_twist"), (PoseStamped, "target_pose")):
            ros.probe.create_subscription(kind, f"cooperative/human/{topic}", self._note, 100)
        until(lambda: self.node.desired() is not None, "the desired motion")

    def _note(self, message: Any) -> None:
        self.said.append((time.monotonic(), message))

    def rates(self) -> np.ndarray:
        """Rates that were said, shape (n, 2)."""
        twists = [item.twist.linear for _, item in list(self.said) if hasattr(item, "twist")]
        return np.array([[item.x, item.y] for item in twists]).reshape(-1, 2)

    def place(self) -> np.ndarray:
        """Where the team's middle is."""
        q = self.monitor.newest().position
        assert q is not None
        return 0.5 * (q[:2] + q[2:])

    def speed(self) -> float:
        """Speed of the desired motion."""
        found = self.node.desired()
        return float(np.linalg.norm(found.velocity)) if found else 0.0

    def publish(self, publisher: Any, message: Any, rate: float, done: Callable[[], Any]) -> None:
        """Publishes at a rate until something is true."""
        end = time.monotonic() + DEADLINE
        while not done():
            assert time.monotonic() < end, "nothing came of it"
            publisher.publish(message)
            time.sleep(1.0 / rate)

    def rests(self) -> None:
        """Waits until the device is let go, the last words are said, and the team rests."""
        until(lambda: self.speed() < 1e-3, "rest")
        until(lambda: self.node._releases_left == 0, "the last words")
        count = len(self.said)
        until(self.monitor.has_new_status(self.node.get_name()))
        assert len(self.said) <= count + 1  # One may have been on its way.


def _flat(values: dict[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", value


def mapping(name: str) -> dict[str, Any]:
    """One of the package's mapping files."""
    return read_parameters(ROOT / "config" / "devices" / f"{name}.yaml")


def joy(axes: list[float], pressed: tuple[int, ...] = (), count: int = 21) -> Joy:
    """A message as drivers make it."""
    message = Joy(axes=axes, buttons=[int(n in pressed) for n in range(count)])
    message.header.frame_id = "joy"
    return message


def test_a_gamepad_leads_while_its_button_is_held(ros: Ros) -> None:
    """Autorepeat at 20 Hz: forward while held, rest on letting go, then silence for others."""
    bench = OperatorHarness(ros, JoyOperator, **mapping("joy_gamepad"))
    driver = ros.probe.create_publisher(Joy, "/joy", 10)
    ros.wait_for_subscribers(driver)
    start = bench.place()
    for _ in range(10):  # The stick alone does nothing.
        driver.publish(joy(FORWARD))
        time.sleep(0.02)
    assert not bench.said
    held = joy(FORWARD, (ENABLE,))
    bench.publish(driver, held, 20.0, lambda: bench.place()[0] > start[0] + 0.05)
    rates = bench.rates()
    np.testing.assert_allclose(rates, np.tile([0.2, 0.0], (len(rates), 1)))
    driver.publish(joy(FORWARD))
    bench.rests()
    assert not bench.rates()[-1].any()
    assert abs(bench.place()[1] - start[1]) < 0.05


def test_a_gamepad_that_is_cut_off_lets_go_until_it_is_held_anew(ros: Ros) -> None:
    """No more messages with the button pressed: rest; they return: still rest, until released."""
    bench = OperatorHarness(ros, JoyOperator, **mapping("joy_gamepad"))
    driver = ros.probe.create_publisher(Joy, "/joy", 10)
    ros.wait_for_subscribers(driver)
    held = joy(FORWARD, (ENABLE,))
    bench.publish(driver, held, 20.0, lambda: bench.speed() > 0.15)
    bench.rests()
    count = len(bench.said)
    for _ in range(10):
        driver.publish(held)
        time.sleep(0.05)
    assert len(bench.said) == count
    driver.publish(joy(REST))
    bench.publish(driver, held, 20.0, lambda: bench.speed() > 0.15)


@pytest.mark.parametrize("rate", [60.0, 500.0], ids=["as its events come", "in a flood"])
def test_a_space_mouse_leads_while_it_is_deflected(ros: Ros, rate: float) -> None:
    """No buttons, nothing at rest, zeros after the last motion."""
    bench = OperatorHarness(ros, JoyOperator, **mapping("joy_spacenav"))
    driver = ros.probe.create_publisher(Joy, "/spacenav/joy", 10)
    ros.wait_for_subscribers(driver)
    deflected = joy([0.0, -0.8, 0.3, 0.0, 0.0, 0.0], count=0)
    bench.publish(driver, deflected, rate, lambda: bench.speed() > 0.1)
    assert (bench.rates()[1:, 1] < 0.0).all()
    driver.publish(joy(REST, count=0))
    bench.rests()


def test_a_bad_message_is_refused_and_moves_nothing(ros: Ros) -> None:
    """Two axes are another device's; the diagnostics say so."""
    bench = OperatorHarness(ros, JoyOperator, **mapping("joy_gamepad"))
    driver = ros.probe.create_publisher(Joy, "/joy", 10)
    ros.wait_for_subscribers(driver)
    driver.publish(joy([1.0, 1.0], (ENABLE,)))
    until(
        lambda: "needs 4" in bench.monitor.value("joy_operator", "last rejection"), "the refusal"
    )
    assert not bench.said


def pose(x: float, y: float, frame: str = "phantom_base") -> PoseStamped:
    """What a haptic device's driver says, in its own frame."""
    message = PoseStamped()
    message.header.frame_id = frame
    message.pose.position.x, message.pose.position.y = x, y
    message.pose.orientation.w = 1.0
    return message


def test_a_tracker_leads_with_its_clutch_from_where_the_team_is(ros: Ros) -> None:
    """Device at 3 m, team at 0: taking hold moves nothing, moving by 6 cm moves it by 6 cm."""
    bench = OperatorHarness(ros, PoseOperator)
    driver = ros.probe.create_publisher(PoseStamped, "device/pose", 10)
    clutch = ros.probe.create_publisher(Bool, "device/clutch", 10)
    ros.wait_for_subscribers(driver, clutch)
    start = bench.place()
    for _ in range(20):
        driver.publish(pose(3.0, 3.0))
        time.sleep(0.01)
    assert not bench.said
    clutch.publish(Bool(data=True))
    bench.publish(driver, pose(3.0, 3.0), 100.0, lambda: len(bench.said) > 10)
    first = bench.said[0][1].pose.position
    np.testing.assert_allclose([first.x, first.y], start, atol=5e-3)
    assert bench.speed() < 1e-3
    for k in range(1, 13):  # As a hand moves: 0.5 m/s.
        driver.publish(pose(3.0 + 0.005 * k, 3.0))
        time.sleep(0.01)
    goal = start + np.array([0.06, 0.0])

    def there() -> bool:
        return bool(np.abs(bench.place() - goal).max() < 3e-3)

    bench.publish(driver, pose(3.06, 3.0), 100.0, there)
    clutch.publish(Bool(data=False))
    driver.publish(pose(3.06, 3.0))
    bench.rests()
    # Held anew elsewhere: nothing jumps.
    clutch.publish(Bool(data=True))
    count = len(bench.said)
    bench.publish(driver, pose(2.0, 1.0), 100.0, lambda: len(bench.said) > count + 10)
    assert np.abs(bench.place() - goal).max() < 5e-3


def test_a_tracker_that_jumps_lets_go(ros: Ros) -> None:
    """A pose half a metre away in one message is a glitch: refused, the clutch lets go."""
    bench = OperatorHarness(ros, PoseOperator)
    driver = ros.probe.create_publisher(PoseStamped, "device/pose", 10)
    clutch = ros.probe.create_publisher(Bool, "device/clutch", 10)
    ros.wait_for_subscribers(driver, clutch)
    clutch.publish(Bool(data=True))
    bench.publish(driver, pose(0.0, 0.0), 100.0, lambda: len(bench.said) > 5)
    start = bench.place()
    bench.publish(driver, pose(0.5, 0.0), 100.0, lambda: bench.node._rejected)
    for _ in range(20):
        driver.publish(pose(0.5, 0.0))
        time.sleep(0.01)
    bench.rests()
    assert np.abs(bench.place() - start).max() < 5e-3


def test_a_button_is_a_clutch_whose_silence_lets_go(ros: Ros) -> None:
    """Autorepeat at 20 Hz; a gamepad that is cut off while poses go on holds nothing any more."""
    bench = OperatorHarness(ros, PoseOperator, tracker={"joy_topic": "/joy", "clutch_button": 2})
    driver = ros.probe.create_publisher(PoseStamped, "device/pose", 10)
    gamepad = ros.probe.create_publisher(Joy, "/joy", 10)
    ros.wait_for_subscribers(driver, gamepad)
    start, moved = bench.place(), 0.0

    def held(step: float, done: Callable[[], Any]) -> None:
        """As a hand moves, at 0.5 m/s at most; the button is told of with every fifth pose."""
        nonlocal moved
        for k in range(round(DEADLINE / 0.01)):
            if done():
                return
            moved = min(moved + step, 0.06)
            driver.publish(pose(3.0 + moved, 3.0))
            if k % 5 == 0:
                gamepad.publish(joy(REST, (2,)))
            time.sleep(0.01)
        raise AssertionError("nothing came of it")

    held(0.0, lambda: len(bench.said) > 10)
    held(5e-3, lambda: abs(bench.place()[0] - start[0] - 0.06) < 3e-3)
    bench.publish(driver, pose(3.06, 3.0), 100.0, lambda: bench.node._releases_left == 0)
    count = len(bench.said)
    gamepad.publish(joy(REST, (2,)))  # Back, and still pressed: it has to be pressed anew.
    bench.publish(driver, pose(3.06, 3.0), 100.0, bench.monitor.has_new_status("pose_operator"))
    assert len(bench.said) <= count + 1
    assert not bench.node.input.clutched


class Keys:
    """A keyboard program on a terminal of its own."""

    def __init__(self) -> None:
        self.keyboard, self.terminal = pty.openpty()

    def make(self, **kwargs: Any) -> KeyboardOperator:
        """The node."""
        return KeyboardOperator(terminal=self.terminal, **kwargs)

    def strike(self, keys: str) -> None:
        """Strikes keys."""
        os.write(self.keyboard, keys.encode())


def test_a_key_leads_while_it_repeats_and_space_stops(ros: Ros) -> None:
    """As a terminal repeats: at once, after half a second, then 30 times a second."""
    keys = Keys()
    before = termios.tcgetattr(keys.terminal)
    bench = OperatorHarness(ros, keys.make)
    keys.strike("d")
    time.sleep(0.5)  # What the keyboard waits before it repeats.
    end = time.monotonic() + DEADLINE
    while bench.place()[1] > -0.05:
        assert time.monotonic() < end, "nothing came of it"
        keys.strike("d")
        time.sleep(0.033)
    rates = bench.rates()
    np.testing.assert_allclose(rates, np.tile([0.0, -0.1], (len(rates), 1)))
    keys.strike(" ")
    until(lambda: not bench.node.dead_man.is_held(time.monotonic()), "the stop")
    bench.rests()
    bench.ros.remove(bench.node)
    assert termios.tcgetattr(keys.terminal)[3] == before[3]  # Echo and lines, as they were.


def test_without_a_terminal_there_is_no_keyboard(ros: Ros) -> None:
    """A pipe is refused in one line."""
    read, write = os.pipe()
    overrides = [Parameter(k, value=v) for k, v in _flat(merged(paper(), {}))]
    with pytest.raises(ScenarioError, match=r"\(terminal\).*allowed: a terminal"):
        KeyboardOperator(terminal=read, context=ros.context, parameter_overrides=overrides)
    os.close(read)
    os.close(write)
