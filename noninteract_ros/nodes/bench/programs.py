# SPDX-License-Identifier: Apache-2.0
"""Real programs to be measured, and what is listened to from outside while they run."""

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from sensor_msgs.msg import JointState

from noninteract_ros.arrays import Array
from noninteract_ros.nodes.common.node import LOOP_QOS
from noninteract_ros.nodes.messages.cdr import JointStateCodec
from noninteract_ros.nodes.messages.messages import stamp_ns
from noninteract_ros.nodes.recording.feed import RawSubscription
from noninteract_ros.nodes.stack.monitor import StackError
from noninteract_ros.nodes.stack.stack import Processes, programs_of
from noninteract_ros.scenario import Scenario

NAMESPACE = "bench"  # beside a stack that may be running
START_TIMEOUT = 180.0  # [s] at the first start on a machine the law is compiled
POLL_PERIOD = 0.004  # [s]


@contextmanager
def ros() -> Iterator[None]:
    """ROS in this process, for the measuring nodes; Ctrl-C stays the caller's."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        yield
    finally:
        rclpy.try_shutdown()


class RoundTrip:
    """Messages of a scenario's size, to another process and back, one after the other.

    Args:
        joints: Names of the joints that a message holds.
    """

    def __init__(self, joints: tuple[str, ...]) -> None:
        command = [sys.executable, "-m", "noninteract_ros.nodes.bench.echo"]
        self._echo = subprocess.Popen([*command, "--ros-args", "-r", f"__ns:=/{NAMESPACE}"])
        self._node = Node("round_trip", namespace=NAMESPACE)
        self._codec = JointStateCodec(joints)
        self._numbers = np.zeros(len(joints))
        self._to = self._node.create_publisher(JointState, "ping", LOOP_QOS)
        self._node.create_subscription(JointState, "pong", self._on_pong, LOOP_QOS, raw=True)
        self._sent: list[int] = []
        deadline = time.monotonic() + START_TIMEOUT
        while not (self._to.get_subscription_count() and self._node.count_publishers("pong")):
            if time.monotonic() > deadline:
                raise StackError("the echo process does not answer")
            time.sleep(0.05)

    def _send(self) -> None:
        self._sent.append(time.perf_counter_ns())
        numbers = self._numbers
        self._to.publish(self._codec.encode(len(self._sent), numbers, numbers, numbers))

    def _on_pong(self, data: bytes) -> None:
        if self._codec.decode(data).stamp_ns == len(self._sent):
            self._send()

    def measure(self, duration: float) -> Array:
        """Times of round trips [us] over so long [s]."""
        executor = EventsExecutor()
        executor.add_node(self._node)
        first = len(self._sent)
        self._send()
        executor.spin_until_future_complete(Future(), duration)
        executor.shutdown(0.5)
        return 1e-3 * np.diff(self._sent[first:])

    def close(self) -> None:
        """Ends both ends."""
        self._echo.terminate()
        self._echo.wait()
        self._node.destroy_node()


@contextmanager
def programs(scenario: Scenario, file: Path, folder: Path, record: bool) -> Iterator[Processes]:
    """The real programs of a scenario, for a while."""
    stack = Processes(programs_of(scenario), file, folder, record, NAMESPACE)
    try:
        yield stack
    finally:
        stack.stop()


def tick_times(stack: Processes, duration: float) -> Array:
    """Mean time per tick [us] between the team's diagnostics, over so long [s].

    Its own diagnostics tell how far it is, so that measuring adds no reader to the loop.
    """
    told: list[tuple[int, int]] = []

    def note(message: DiagnosticArray) -> None:
        for status in message.status:
            ticks = [int(item.value) for item in status.values if item.key == "ticks"]
            if status.name == f"/{NAMESPACE}/robot_team" and ticks and ticks[0] > 0:
                told.append((stamp_ns(message.header.stamp), ticks[0]))

    node = Node("listener", namespace=NAMESPACE)
    node.create_subscription(DiagnosticArray, "/diagnostics", note, 50)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    _until(stack, lambda: len(told) > 1, lambda: executor.spin_once(timeout_sec=0.1))
    first, end = len(told) - 1, time.monotonic() + duration
    while time.monotonic() < end or len(told) < first + 2:
        executor.spin_once(timeout_sec=0.1)
    executor.shutdown(0.5)
    node.destroy_node()
    return np.array([1e-3 * (b[0] - a[0]) / (b[1] - a[1]) for a, b in pairwise(told[first:])])


def _until(stack: Processes, ready: Callable[[], bool], wait: Callable[[], None]) -> None:
    """Waits for a stack to come up.

    Raises:
        StackError: A program has ended, or the time is over.
    """
    deadline = time.monotonic() + START_TIMEOUT
    while not ready():
        if problem := stack.problem():
            raise StackError(problem)
        if time.monotonic() > deadline:
            raise StackError(f"the programs do not move after {START_TIMEOUT:.0f} s")
        wait()


def command_times(stack: Processes, duration: float) -> list[int]:
    """When the controller sent its commands [ns], over so long [s]."""
    instants: list[int] = []

    def note(topic: str, kind: str, received: int, sent: int, data: bytes, number: int) -> None:
        instants.append(sent)

    node = Node("listener", namespace=NAMESPACE)
    feed = RawSubscription(node, f"/{NAMESPACE}/joint_commands", "sensor_msgs/msg/JointState")

    def listen() -> None:
        feed.drain(note)
        time.sleep(POLL_PERIOD)

    _until(stack, lambda: bool(instants), listen)
    began = instants[-1] + 10**9  # The start is not what is measured.
    while instants[-1] < began + 1e9 * duration:
        listen()
        if problem := stack.problem():
            raise StackError(problem)
    node.destroy_node()
    return [instant for instant in instants if instant >= began]
