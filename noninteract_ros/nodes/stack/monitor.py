# SPDX-License-Identifier: Apache-2.0
"""Watches a stack from outside: who is there, who hears whom, how far the run is."""

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
from noninteract_ros.nodes.common.team_status import FINISHED
from noninteract_ros.nodes.messages.messages import Level


class StackError(NoninteractError):
    """The programs of a run do not work together; the text says who and why."""


@dataclass(frozen=True)
class NodeStatus:
    """Newest diagnostics of one node."""

    level: Level
    text: str
    values: dict[str, str]


class Monitor:
    """A node beside the stack, spun only inside its own methods.

    Args:
        namespace: Namespace of the stack.
        problem: Tells what went wrong with a program, or an empty text.
    """

    def __init__(self, namespace: str, problem: Callable[[], str]) -> None:
        self._prefix = f"/{namespace}"
        self._problem = problem
        self._node = Node("demo", namespace=namespace)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self.status: dict[str, NodeStatus] = {}
        self._node.create_subscription(DiagnosticArray, "/diagnostics", self._note, 50)

    def _note(self, message: DiagnosticArray) -> None:
        for item in message.status:
            values = {pair.key: pair.value for pair in item.values}
            name = item.name.rpartition("/")[2]
            self.status[name] = NodeStatus(Level(item.level[0]), item.message, values)

    def close(self) -> None:
        """Ends the node."""
        self._executor.shutdown(0.5)
        self._node.destroy_node()

    def spin(self, seconds: float) -> None:
        """Listens for a while.

        Raises:
            StackError: A program has ended.
        """
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0 and rclpy.ok():
            self._executor.spin_once(timeout_sec=left)
        if problem := self._problem():
            raise StackError(problem)

    def others(self, seconds: float) -> list[str]:
        """Nodes that are in the namespace already, listened for so long [s]."""
        self.spin(seconds)
        found = self._node.get_node_names_and_namespaces()
        own = self._node.get_name()
        return [name for name, space in found if space == self._prefix and name != own]

    def wait_until_ready(self, names: list[str], timeout: float) -> None:
        """Waits until every node is there and every publisher has found all its subscribers.

        Raises:
            StackError: A program has ended, or the time is over.
        """
        deadline = time.monotonic() + timeout
        while (missing := self._missing(names)) and rclpy.ok():
            if time.monotonic() > deadline:
                raise StackError(f"not ready after {timeout:.0f} s: {missing}")
            self.spin(0.1)

    def _missing(self, names: list[str]) -> str:
        for name in names:
            if name not in self.status:
                return f"{name} does not speak"
        for name in set(names) - {"recorder"}:
            for entry in self.status[name].values["subscribers"].split(", "):
                topic, _, count = entry.rpartition(" ")
                listeners = self._node.get_subscriptions_info_by_topic(topic)
                if topic.startswith(f"{self._prefix}/") and (
                    int(count) != len(listeners)
                    or "recorder" not in [item.node_name for item in listeners]
                ):
                    return f"{topic} of {name} has {count} of {len(listeners)} subscribers"
        return ""

    def begin(self, timeout: float) -> None:
        """Lets the paused team go.

        Raises:
            StackError: The team does not answer.
        """
        client = self._node.create_client(SetBool, "robot_team/pause")
        if not client.wait_for_service(timeout):
            raise StackError("robot_team offers no service ~/pause")
        answer: Any = client.call_async(SetBool.Request(data=False))
        self._executor.spin_until_future_complete(answer, timeout)
        if not answer.done() or not answer.result().success:
            raise StackError("robot_team did not answer ~/pause")

    def time(self) -> float:
        """The team's time, as last heard [s]."""
        team = self.status.get("robot_team")
        return float(team.values["time [s]"]) if team else 0.0

    def finished(self) -> bool:
        """Whether the team has come to its end."""
        team = self.status.get("robot_team")
        return team is not None and team.text == FINISHED
