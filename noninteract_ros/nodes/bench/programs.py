# SPDX-License-Identifier: Apache-2.0
"""Measured programs, and the nodes that measure them."""

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
from noninteract_ros.nodes.common.guarded_node import LOOP_QOS
from noninteract_ros.nodes.messages.cdr import JointStateCodec
from noninteract_ros.nodes.messages.messages import stamp_ns
from noninteract_ros.nodes.recording.raw_subscription import RawSubscription
from noninteract_ros.nodes.stack.monitor import StackError
from noninteract_ros.nodes.stack.stack import Processes, scenario_programs
from noninteract_ros.scenario import Scenario

NAMESPACE = "bench"  # beside a stack that may be running
START_TIMEOUT = 180.0  # [s] long, because the first start on a machine compiles the law
POLL_PERIOD = 0.004  # [s]


@contextmanager
def ros() -> Iterator[None]:
    """Initialize ROS in this process without signal handlers."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        yield
    finally:
        rclpy.try_shutdown()


class RoundTrip:
    """Round trips of a JointState to another process and back, one after the other.

    Args:
        joints: Names of the joints in the message.
    """

    def __init__(self, joints: tuple[str, ...]) -> None:
        command = [sys.executable, "-m", "noninteract_ros.nodes.bench.echo"]
        self._echo = subprocess.Popen([*command, "--ros-args", "-r", f"__ns:=/{NAMESPACE}"])
        self._node = Node("round_trip", namespace=NAMESPACE)
        self._codec = JointStateCodec(joints)
        self._values = np.zeros(len(joints))
        self._publisher = self._node.create_publisher(JointState, "ping", LOOP_QOS)
        self._node.create_subscription(JointState, "pong", self._on_pong, LOOP_QOS, raw=True)
        self._sent: list[int] = []
        deadline = time.monotonic() + START_TIMEOUT
        while not (
            self._publisher.get_subscription_count() and self._node.count_publishers("pong")
        ):
            if time.monotonic() > deadline:
                raise StackError("the echo process does not respond")
            time.sleep(0.05)

    def _send(self) -> None:
        self._sent.append(time.perf_counter_ns())
        values = self._values
        self._publisher.publish(self._codec.encode(len(self._sent), values, values, values))

    def _on_pong(self, data: bytes) -> None:
        if self._codec.decode(data).stamp_ns == len(self._sent):
            self._send()

    def measure(self, duration: float) -> Array:
        """Return the times of round trips [us] within a duration [s]."""
        executor = EventsExecutor()
        executor.add_node(self._node)
        first = len(self._sent)
        self._send()
        executor.spin_until_future_complete(Future(), duration)
        executor.shutdown(0.5)
        return 1e-3 * np.diff(self._sent[first:])

    def close(self) -> None:
        """End the process and destroy the node."""
        self._echo.terminate()
        self._echo.wait()
        self._node.destroy_node()


@contextmanager
def programs(scenario: Scenario, file: Path, folder: Path, record: bool) -> Iterator[Processes]:
    """Run the programs of a scenario."""
    stack = Processes(scenario_programs(scenario), file, folder, record, NAMESPACE)
    try:
        yield stack
    finally:
        stack.stop()


def tick_times(stack: Processes, duration: float) -> Array:
    """Return mean times per tick [us] between the team's diagnostics, within a duration [s].

    The diagnostics contain the number of ticks, so that measuring adds no subscription to the
    loop.
    """
    samples: list[tuple[int, int]] = []

    def on_diagnostics(message: DiagnosticArray) -> None:
        for status in message.status:
            ticks = [int(item.value) for item in status.values if item.key == "ticks"]
            if status.name == f"/{NAMESPACE}/robot_team" and ticks and ticks[0] > 0:
                samples.append((stamp_ns(message.header.stamp), ticks[0]))

    node = Node("listener", namespace=NAMESPACE)
    node.create_subscription(DiagnosticArray, "/diagnostics", on_diagnostics, 50)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    _wait_until(stack, lambda: len(samples) > 1, lambda: executor.spin_once(timeout_sec=0.1))
    first, end = len(samples) - 1, time.monotonic() + duration
    while time.monotonic() < end or len(samples) < first + 2:
        executor.spin_once(timeout_sec=0.1)
    executor.shutdown(0.5)
    node.destroy_node()
    return np.array([1e-3 * (b[0] - a[0]) / (b[1] - a[1]) for a, b in pairwise(samples[first:])])


def _wait_until(stack: Processes, ready: Callable[[], bool], wait: Callable[[], None]) -> None:
    """Wait until the programs run.

    Raises:
        StackError: A program has ended, or the timeout has elapsed.
    """
    deadline = time.monotonic() + START_TIMEOUT
    while not ready():
        if failure := stack.failure():
            raise StackError(failure)
        if time.monotonic() > deadline:
            raise StackError(f"the programs do not run after {START_TIMEOUT:.0f} s")
        wait()


def command_times(stack: Processes, duration: float) -> list[int]:
    """Return the times of the controller's commands [ns] within a duration [s]."""
    times: list[int] = []

    def store(topic: str, kind: str, received: int, sent: int, data: bytes, number: int) -> None:
        times.append(sent)

    node = Node("listener", namespace=NAMESPACE)
    topic = f"/{NAMESPACE}/joint_commands"
    subscription = RawSubscription(node, topic, "sensor_msgs/msg/JointState")

    def poll() -> None:
        subscription.drain(store)
        time.sleep(POLL_PERIOD)

    _wait_until(stack, lambda: bool(times), poll)
    start = times[-1] + 10**9  # Excludes the start of the programs.
    while times[-1] < start + 1e9 * duration:
        poll()
        if failure := stack.failure():
            raise StackError(failure)
    node.destroy_node()
    return [sent for sent in times if sent >= start]
