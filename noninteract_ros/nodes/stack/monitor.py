# SPDX-License-Identifier: Apache-2.0
"""Monitoring of a stack: nodes, connections and progress of a run."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_srvs.srv import SetBool

from noninteract_ros.errors import NoninteractError
from noninteract_ros.nodes.common.team_status import FINISHED, main_state
from noninteract_ros.nodes.messages.messages import Level


class StackError(NoninteractError):
    """A program of a run failed; the text names it and the reason."""


@dataclass(frozen=True)
class NodeStatus:
    """Newest diagnostics of one node.

    Attributes:
        level: Level of its DiagnosticStatus.
        text: Its message.
        values: Its key-value pairs.
    """

    level: Level
    text: str
    values: dict[str, str]


class Monitor:
    """Node beside the stack; it spins only inside its own methods.

    Args:
        namespace: Namespace of the stack.
        failure: Returns the failure of a program, or an empty text.

    Attributes:
        status: Newest diagnostics of each node.
    """

    def __init__(self, namespace: str, failure: Callable[[], str]) -> None:
        self._prefix = f"/{namespace}"
        self._failure = failure
        self._node = Node("demo", namespace=namespace)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self.status: dict[str, NodeStatus] = {}
        self._node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 50)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for item in message.status:
            values = {pair.key: pair.value for pair in item.values}
            name = item.name.rpartition("/")[2]
            self.status[name] = NodeStatus(Level(item.level[0]), item.message, values)

    def close(self) -> None:
        """Destroy the node."""
        self._executor.shutdown(0.5)
        self._node.destroy_node()

    def spin(self, seconds: float) -> None:
        """Spin for a duration [s].

        Raises:
            StackError: A program has ended.
        """
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0 and rclpy.ok():
            self._executor.spin_once(timeout_sec=left)
        if failure := self._failure():
            raise StackError(failure)

    def other_nodes(self, seconds: float) -> list[str]:
        """Return other nodes in the namespace, discovered within a duration [s]."""
        self.spin(seconds)
        found = self._node.get_node_names_and_namespaces()
        own = self._node.get_name()
        return [name for name, namespace in found if namespace == self._prefix and name != own]

    def wait_until_ready(self, names: list[str], timeout: float) -> None:
        """Wait until all nodes publish diagnostics and all publishers match their subscriptions.

        Raises:
            StackError: A program has ended, or the timeout has elapsed.
        """
        deadline = time.monotonic() + timeout
        while (missing := self._missing(names)) and rclpy.ok():
            if time.monotonic() > deadline:
                raise StackError(f"not ready after {timeout:.0f} s: {missing}")
            self.spin(0.1)

    def _missing(self, names: list[str]) -> str:
        """Return the first missing node or connection, or an empty text."""
        for name in names:
            if name not in self.status:
                return f"no diagnostics of {name}"
        for name in set(names) - {"recorder"}:
            for entry in self.status[name].values["subscribers"].split(", "):
                topic, _, count = entry.rpartition(" ")
                subscriptions = self._node.get_subscriptions_info_by_topic(topic)
                if topic.startswith(f"{self._prefix}/") and (
                    int(count) != len(subscriptions)
                    or "recorder" not in [item.node_name for item in subscriptions]
                ):
                    return f"{topic} of {name} has {count} of {len(subscriptions)} subscribers"
        return ""

    def unpause(self, timeout: float) -> None:
        """Start the paused team.

        Raises:
            StackError: The team does not respond.
        """
        client = self._node.create_client(SetBool, "robot_team/pause")
        if not client.wait_for_service(timeout):
            raise StackError("service robot_team/pause is not available")
        future: Any = client.call_async(SetBool.Request(data=False))
        self._executor.spin_until_future_complete(future, timeout)
        if not future.done() or not future.result().success:
            raise StackError("robot_team/pause did not respond")

    def time(self) -> float:
        """Return the last received time of the team [s]."""
        team = self.status.get("robot_team")
        return float(team.values["time [s]"]) if team else 0.0

    def finished(self) -> bool:
        """Return True if the team has finished."""
        team = self.status.get("robot_team")
        return team is not None and main_state(team.text) == FINISHED
