# SPDX-License-Identifier: Apache-2.0
"""Nodes in this process, and an ear for what they say."""

import gc
import os
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from copy import deepcopy
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from repository import ROOT
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
from waiting import WITNESSES, until

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
    """The scenario of the paper with changes: `key=value`, blocks merged; None removes a key."""
    values = read_parameters(ROOT / "config" / "paper.yaml")
    return merged(merged(values, {"haptic": {"start_time": 0.05}}), changes)


def merged(values: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """A nested mapping with changes."""
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
    """Dotted keys and values."""
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", value


class Ear:
    """What a team and its controller say: every message once, by its stamp [ns]."""

    def __init__(self, node: Node, joints: list[str]) -> None:
        self.node, self._codec = node, JointStateCodec(joints)
        self.states: dict[int, bytes] = {}
        self.commands: dict[int, bytes] = {}
        self.status: dict[str, tuple[int, str, dict[str, str]]] = {}
        self._told_at: dict[str, float] = {}
        self.now = 0.0
        take_state, take_command = self._keep(self.states), self._keep(self.commands)
        node.create_subscription(JointState, "joint_states", take_state, DEEP, raw=True)
        node.create_subscription(JointState, "joint_commands", take_command, DEEP, raw=True)
        node.create_subscription(DiagnosticArray, "/diagnostics", self._note, DEEP)

    def _keep(self, kept: dict[int, bytes]) -> Callable[[bytes], None]:
        def take(data: bytes) -> None:
            stamp = int.from_bytes(data[4:8], "little") * 10**9
            stamp += int.from_bytes(data[8:12], "little")
            if kept is self.states:
                self.now = seconds(stamp)
            kept.setdefault(stamp, bytes(data))

        return take

    def _note(self, message: DiagnosticArray) -> None:
        for item in message.status:
            values = {pair.key: pair.value for pair in item.values}
            name = item.name.rpartition("/")[2]
            self._told_at[name] = time.monotonic()
            self.status[name] = (item.level[0], item.message, values)

    def last_words(self) -> list[str]:
        """What each node said last, and how long ago."""
        now = time.monotonic()
        return [
            f"{name}, {now - self._told_at[name]:.1f} s ago: {text} {values}"
            for name, (_, text, values) in list(self.status.items())
        ]

    def says(self, node: str, text: str) -> Callable[[], bool]:
        """Whether the newest diagnostics of a node contain a text."""
        return lambda: text in self.status.get(node, (0, "", {}))[1]

    def value(self, node: str, key: str) -> str:
        """One of the values in the newest diagnostics of a node."""
        return self.status.get(node, (0, "", {}))[2].get(key, "")

    def renewed(self, node: str) -> Callable[[], bool]:
        """Whether a node has told of itself since now."""
        before = self.status.get(node)
        return lambda: self.status.get(node) is not before

    def newest(self) -> JointArrays:
        """The newest state."""
        return self._codec.decode(self.states[next(reversed(self.states))])

    def history(self, kept: dict[int, bytes]) -> tuple[np.ndarray, ...]:
        """Times [s], positions, velocities and efforts, a row per stamp."""
        rows = [self._codec.decode(kept[stamp]) for stamp in sorted(kept)]
        times = np.array([seconds(row.stamp_ns) for row in rows])
        columns = [
            [np.zeros(0) if item is None else item for item in column]
            for column in list(zip(*rows, strict=True))[1:]
        ]
        return (times, *(np.array(column) for column in columns))


class Ros:
    """A private context with an executor in a thread; nothing touches rclpy's own."""

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
        self._ears: list[Ear] = []
        self._failures: list[Exception] = []
        self._threads: list[threading.Thread] = []
        self.probe = self.node(rclpy.create_node("probe", namespace="team", context=self.context))
        self._thread(spin, self._executor, self.context)

    def _thread(self, target: Callable[..., None], *arguments: Any) -> None:
        def run() -> None:
            try:
                target(*arguments)
            except Exception as error:
                self._failures.append(error)

        self._threads.append(threading.Thread(target=run, daemon=True))
        self._threads[-1].start()

    def node(self, node: Any) -> Any:
        """Lets a node live here."""
        self._executor.add_node(node)
        self._nodes.append(node)
        if isinstance(node, ScenarioNode) and node.has_loop:
            self._thread(self._loop, node)
        return node

    def _loop(self, node: ScenarioNode) -> None:
        with until_shutdown(self.context):
            node.loop()

    def make(self, name: str, values: Mapping[str, Any]) -> Any:
        """One of the programs' nodes, with a scenario."""
        overrides = [Parameter(key, value=value) for key, value in flat(values)]
        return self.node(NODES[name](context=self.context, parameter_overrides=overrides))

    def remove(self, node: Node) -> None:
        """Ends a node."""
        self._executor.remove_node(node)
        self._nodes.remove(node)
        node.destroy_node()

    def stack(self, values: Mapping[str, Any]) -> "Stack":
        """All nodes of a scenario."""
        return Stack(self, values)

    def ear(self, values: Mapping[str, Any]) -> Ear:
        """Listens to a team."""
        ear = Ear(self.probe, list(Scenario.from_dict(dict(values)).build_team().joint_names))
        self._ears.append(ear)
        WITNESSES.append(ear.last_words)
        return ear

    def call(self, kind: type, service: str, request: Any = None) -> Any:
        """The answer of a service."""
        client = self.probe.create_client(kind, service)
        until(client.service_is_ready, f"service {service}")
        answer = client.call_async(kind.Request() if request is None else request)
        until(answer.done, f"answer of {service}")
        self.probe.destroy_client(client)
        return answer.result()

    def matched(self, *publishers: Any) -> None:
        """Waits until publishers have found a subscriber each."""
        for publisher in publishers:
            until(publisher.get_subscription_count, f"a subscriber of {publisher.topic_name}")

    def close(self) -> None:
        """Ends everything; what a node raised is raised here.

        Without collecting garbage, and then destroying the context, participants linger on.
        """
        for ear in self._ears:
            WITNESSES.remove(ear.last_words)
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
    """All nodes of a scenario in this process; the team begins when everybody hears everybody."""

    def __init__(self, ros: Ros, values: Mapping[str, Any]) -> None:
        self.ros = ros
        self.values = merged(values, {"start_paused": True})
        self.ear = ros.ear(self.values)
        names = ["controller"]
        names += [
            name
            for name, block in (("haptic_emulator", "haptic"), ("relative_planner", "planner"))
            if block in values
        ]
        self.nodes = {name: ros.make(name, self.values) for name in ["robot_team", *names]}

    def begin(self) -> "Stack":
        """Lets the team go."""
        until(self._matched, "everybody hears everybody")
        go(self.ros)
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
        """Waits until the team has come to a time [s]."""
        until(
            lambda: self.ear.now >= time_, lambda: f"the team at {time_} s, not {self.ear.now} s"
        )


def go(ros: Ros) -> None:
    """Lets a paused team go."""
    ros.call(SetBool, "robot_team/pause", SetBool.Request(data=False))
