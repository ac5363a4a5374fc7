# SPDX-License-Identifier: Apache-2.0
"""Nodes in the test process, and a monitor of their topics."""

import gc
import os
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from copy import deepcopy
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import ListParameters
from rclpy.duration import Duration
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from repository import ROOT
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
from waiting import DEADLINE, REPORTS, until

from noninteract_ros.clock import seconds
from noninteract_ros.nodes.common.node import ScenarioNode, spin
from noninteract_ros.nodes.common.program import until_shutdown
from noninteract_ros.nodes.controller.controller import Controller
from noninteract_ros.nodes.messages.cdr import JointArrays, JointStateCodec
from noninteract_ros.nodes.sources.haptic_emulator import HapticEmulator
from noninteract_ros.nodes.sources.relative_planner import RelativePlanner
from noninteract_ros.nodes.team.robot_team import RobotTeam
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import read_parameters

DEEP = QoSProfile(depth=20000)
NODES: dict[str, Callable[..., ScenarioNode]] = {
    "robot_team": RobotTeam,
    "controller": Controller,
    "haptic_emulator": HapticEmulator,
    "relative_planner": RelativePlanner,
}


def paper(**changes: Any) -> dict[str, Any]:
    """Return the scenario `paper` with changes; blocks are merged, None removes a key."""
    values = read_parameters(ROOT / "config" / "paper.yaml")
    return merged(merged(values, {"haptic": {"start_time": 0.05}}), changes)


def merged(values: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a nested mapping with changes merged."""
    result = deepcopy(dict(values))
    for key, value in changes.items():
        if value is None:
            result.pop(key, None)
        elif isinstance(value, Mapping) and isinstance(result.get(key), Mapping):
            result[key] = merged(result[key], value)
        else:
            result[key] = value
    return result


def flat(values: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted keys and values."""
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", value


class TeamMonitor:
    """Subscriptions to the states, commands and diagnostics of a team.

    Args:
        node: Node that subscribes.
        joints: Names of the joints of the team.

    Attributes:
        states: First joint_states message of each stamp [ns].
        commands: First joint_commands message of each stamp [ns].
        received: Number of messages by topic, including repeated ones.
        status: Newest level, message and values of each node.
        now: Time of the newest state [s].
    """

    def __init__(self, node: Node, joints: list[str]) -> None:
        self.node, self._codec = node, JointStateCodec(joints)
        self.states: dict[int, bytes] = {}
        self.commands: dict[int, bytes] = {}
        self.status: dict[str, tuple[int, str, dict[str, str]]] = {}
        self.received = {"joint_states": 0, "joint_commands": 0}
        self._status_received_at: dict[str, float] = {}
        self.now = 0.0
        for topic, messages in (("joint_states", self.states), ("joint_commands", self.commands)):
            callback = partial(self._on_joints, topic, messages)
            node.create_subscription(JointState, topic, callback, DEEP, raw=True)
        node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, DEEP)

    def _on_joints(self, topic: str, messages: dict[int, bytes], data: bytes) -> None:
        stamp = int.from_bytes(data[4:8], "little") * 10**9
        stamp += int.from_bytes(data[8:12], "little")
        if messages is self.states:
            self.now = seconds(stamp)
        messages.setdefault(stamp, bytes(data))
        self.received[topic] += 1

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for item in message.status:
            values = {pair.key: pair.value for pair in item.values}
            name = item.name.rpartition("/")[2]
            self._status_received_at[name] = time.monotonic()
            self.status[name] = (item.level[0], item.message, values)

    def report(self) -> list[str]:
        """Return the newest status of each node and its age."""
        now = time.monotonic()
        return [
            f"{name}, {now - self._status_received_at[name]:.1f} s ago: {text} {values}"
            for name, (_, text, values) in list(self.status.items())
        ]

    def has_status(self, node: str, text: str) -> Callable[[], bool]:
        """Return a condition: the newest status message of a node contains a text."""
        return lambda: text in self.status.get(node, (0, "", {}))[1]

    def wait_for_status(self, node: str, text: str) -> None:
        """Wait until the newest status message of a node contains a text."""
        until(self.has_status(node, text), lambda: f"{node}: {text}")

    def value(self, node: str, key: str) -> str:
        """Return a value of the newest status of a node, or ""."""
        return self.status.get(node, (0, "", {}))[2].get(key, "")

    def has_new_status(self, node: str) -> Callable[[], bool]:
        """Return a condition: a status of a node was received after this call."""
        before = self.status.get(node)
        return lambda: self.status.get(node) is not before

    def wait_for_timers(self, node: str) -> None:
        """Wait for two more status messages, in whose period all faster timers have run."""
        for _ in range(2):
            until(self.has_new_status(node), f"diagnostics of {node}")

    def newest(self) -> JointArrays:
        """Return the newest state."""
        return self._codec.decode(self.states[next(reversed(self.states))])

    def history(self, messages: dict[int, bytes]) -> tuple[np.ndarray, ...]:
        """Return times [s], positions, velocities and efforts, one row per stamp."""
        rows = [self._codec.decode(messages[stamp]) for stamp in sorted(messages)]
        times = np.array([seconds(row.stamp_ns) for row in rows])
        columns = [
            [np.zeros(0) if item is None else item for item in column]
            for column in list(zip(*rows, strict=True))[1:]
        ]
        return (times, *(np.array(column) for column in columns))


class Ros:
    """Context of one test with an executor in a thread.

    Args:
        domain: ROS domain.

    Attributes:
        context: Context, not the default one of rclpy.
        probe: Node of the test itself.
    """

    def __init__(self, domain: int) -> None:
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        self.context = rclpy.Context()
        rclpy.init(
            context=self.context,
            domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        self._executor = EventsExecutor(context=self.context)
        self._nodes: list[Node] = []
        self._monitors: list[TeamMonitor] = []
        self._failures: list[Exception] = []
        self._threads: list[threading.Thread] = []
        self._loops: dict[Node, threading.Thread] = {}
        self.probe = self.add_node(
            rclpy.create_node("probe", namespace="team", context=self.context)
        )
        self._thread(spin, self._executor, self.context)

    def _thread(self, target: Callable[..., None], *arguments: Any) -> threading.Thread:
        def run() -> None:
            try:
                target(*arguments)
            except Exception as error:
                self._failures.append(error)

        self._threads.append(threading.Thread(target=run, daemon=True))
        self._threads[-1].start()
        return self._threads[-1]

    def add_node(self, node: Any) -> Any:
        """Add a node to the executor, and run its loop in a thread."""
        self._executor.add_node(node)
        self._nodes.append(node)
        if isinstance(node, ScenarioNode) and node.has_loop:
            self._loops[node] = self._thread(self._loop, node)
        return node

    def _loop(self, node: ScenarioNode) -> None:
        with until_shutdown(self.context):
            node.loop()

    def make(self, name: str, values: Mapping[str, Any]) -> Any:
        """Create the node of a program with a scenario."""
        overrides = [Parameter(key, value=value) for key, value in flat(values)]
        return self.add_node(NODES[name](context=self.context, parameter_overrides=overrides))

    def remove(self, node: Node) -> None:
        """Destroy a node."""
        self._executor.remove_node(node)
        self._nodes.remove(node)
        thread = self._loops.pop(node, None)
        if thread is not None:
            node._destroyed = True
            thread.join(DEADLINE)
        node.destroy_node()

    def stack(self, values: Mapping[str, Any]) -> "Stack":
        """Create all nodes of a scenario."""
        return Stack(self, values)

    def monitor(self, values: Mapping[str, Any]) -> TeamMonitor:
        """Create a monitor of the team of a scenario."""
        joints = list(Scenario.from_dict(dict(values)).team.joint_names)
        monitor = TeamMonitor(self.probe, joints)
        self._monitors.append(monitor)
        REPORTS.append(monitor.report)
        return monitor

    def call(self, kind: type, service: str, request: Any = None) -> Any:
        """Call a service and return its response."""
        client = self.probe.create_client(kind, service)
        until(client.service_is_ready, f"service {service}")
        future = client.call_async(kind.Request() if request is None else request)
        until(future.done, f"response of {service}")
        self.probe.destroy_client(client)
        return future.result()

    def wait_for_subscribers(self, *publishers: Any) -> None:
        """Wait until each publisher has matched a subscriber."""
        for publisher in publishers:
            until(publisher.get_subscription_count, f"a subscriber of {publisher.topic_name}")

    def drain(self) -> None:
        """Wait until all messages of the nodes here, and the answers to them, are received.

        Sequence barrier for tests that nothing happens: an acknowledged message is in the queue of
        the executor, and the response of a service passes through the same queue after it.
        """
        for _ in range(2):
            for publisher in chain.from_iterable(node.publishers for node in self._nodes):
                assert publisher.wait_for_all_acked(Duration(seconds=DEADLINE))
            self.call(ListParameters, "probe/list_parameters")

    def close(self) -> None:
        """Destroy all nodes and the context; raise the first exception of a node.

        Participants survive unless garbage is collected before the context is destroyed.
        """
        for monitor in self._monitors:
            REPORTS.remove(monitor.report)
        self.context.try_shutdown()
        for thread in self._threads:
            thread.join(2.0)
        for node in self._nodes:
            node.destroy_node()
        self._nodes.clear()
        del self._executor, self.probe
        gc.collect()
        self.context.destroy()
        if self._failures:
            raise self._failures[0]


class Stack:
    """All nodes of a scenario in the test process, with a paused team.

    Args:
        ros: Context.
        values: Values of the scenario.

    Attributes:
        monitor: Monitor of the team.
        nodes: Nodes by program name.
    """

    def __init__(self, ros: Ros, values: Mapping[str, Any]) -> None:
        self.ros = ros
        self.values = merged(values, {"start_paused": True})
        self.monitor = ros.monitor(self.values)
        names = ["controller"]
        names += [
            name
            for name, block in (("haptic_emulator", "haptic"), ("relative_planner", "planner"))
            if block in values
        ]
        self.nodes = {name: ros.make(name, self.values) for name in ["robot_team", *names]}

    def start(self) -> "Stack":
        """Unpause the team once all publishers have matched their subscribers."""
        until(self._matched, "all publishers and subscribers matched")
        unpause(self.ros)
        return self

    def _matched(self) -> bool:
        topics = ("/team/joint_", "/reference", "/feedback", "/external_wrench")
        return all(
            publisher.get_subscription_count()
            == self.ros.probe.count_subscribers(publisher.topic_name)
            for node in self.nodes.values()
            for publisher in node.publishers
            if any(topic in publisher.topic_name for topic in topics)
        ) and all(
            self.ros.probe.count_subscribers(f"/team/{topic}") == count
            for topic, count in (("joint_states", len(self.nodes)), ("joint_commands", 2))
        )

    def run_until(self, time_: float) -> None:
        """Wait until the team has reached a time [s]."""
        until(
            lambda: self.monitor.now >= time_,
            lambda: f"the team at {time_} s, not {self.monitor.now} s",
        )


def unpause(ros: Ros) -> None:
    """Unpause the team."""
    ros.call(SetBool, "robot_team/pause", SetBool.Request(data=False))
