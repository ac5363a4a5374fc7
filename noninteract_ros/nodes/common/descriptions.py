# SPDX-License-Identifier: Apache-2.0
"""Robot descriptions (URDF) received on topics, as robot_state_publisher publishes them."""

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any

from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

from noninteract_ros.errors import ScenarioError
from noninteract_ros.scenario.blocks import description_topics, load_robot

# Latched: subscribers that join later receive the last message too.
LATCHED_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# Publishers that repeat their message need not be latched, nor reliable.
REPEATED_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
REPORT_PERIOD = 0.5  # [s] between diagnostics while a node waits
LOG_PERIOD = 5.0  # [s] between log lines while a node waits

Report = Callable[[str, bool], None]


class RobotDescriptions:
    """Subscriptions to the robot descriptions that a scenario takes from topics.

    A description that is not a valid URDF is rejected, and the next one is awaited. Once all are
    received they must not change, since the running model was built from them.

    Args:
        node: Node that subscribes.
        values: Nested values of a scenario.
        on_change: Called when a description changes after all were received.

    """

    def __init__(
        self, node: Node, values: Mapping[str, Any], on_change: Callable[[], None]
    ) -> None:
        self._node, self._values, self._on_change = node, values, on_change
        self._texts: dict[str, str] = {}
        self._complete = False
        self._rejected: dict[str, str] = {}
        self._changed: dict[str, str] = {}
        self._topics = description_topics(values)
        for robot, topic in self._topics.items():
            callback = partial(self._on_description, robot, topic)
            for qos in (LATCHED_QOS, REPEATED_QOS):
                node.create_subscription(String, topic, callback, qos)

    def wait(self, report: Report, timeout: float = float("inf")) -> dict[str, Any]:
        """Wait for all descriptions, spinning the node in a temporary executor.

        Args:
            report: Called periodically with a status text, and True if a description was rejected.
            timeout: Maximum wait [s].

        Returns:
            The values of the scenario, with the URDF texts inserted.

        Raises:
            ScenarioError: The scenario does not fit a description, or the timeout has expired.
            ExternalShutdownException: The context was shut down.
        """
        executor = SingleThreadedExecutor(context=self._node.context)
        executor.add_node(self._node)
        end, reported_at, logged_at = time.monotonic() + timeout, -REPORT_PERIOD, -LOG_PERIOD
        try:
            while missing := [name for name in self._topics if name not in self._texts]:
                now = time.monotonic()
                text = self.problem or self._missing_text(missing)
                if now > end:
                    key = f"{missing[0]}.urdf"
                    raise ScenarioError(key, self._topics[missing[0]], f"a URDF on it: {text}")
                if now - reported_at >= REPORT_PERIOD:
                    report(text, bool(self.problem))
                    reported_at = now
                if now - logged_at >= LOG_PERIOD:
                    self._node.get_logger().info(text)
                    logged_at = now
                executor.spin_once(timeout_sec=0.1)
        finally:
            with suppress(ExternalShutdownException):
                executor.remove_node(self._node)
                executor.shutdown(0.5)
        self._complete = True
        return {name: self._with_text(name, block) for name, block in self._values.items()}

    @property
    def problem(self) -> str:
        """Error text of rejected and changed descriptions, or "". A change stays an error."""
        return "; ".join([*self._rejected.values(), *self._changed.values()])

    def is_subscribed_to(self, topic: str) -> bool:
        """Return True if a description is received on this topic."""
        resolve = self._node.resolve_topic_name
        return resolve(topic) in map(resolve, self._topics.values())

    def _missing_text(self, missing: list[str]) -> str:
        topics = (self._node.resolve_topic_name(self._topics[name]) for name in missing)
        named = (f"{name} on {topic}" for name, topic in zip(missing, topics, strict=True))
        return f"waiting for the description of {', '.join(named)}"

    def _with_text(self, name: str, block: Any) -> Any:
        return block | {"urdf_text": self._texts[name]} if name in self._texts else block

    def _on_description(self, robot: str, topic: str, message: String) -> None:
        if self._complete:
            if message.data.strip() != self._texts[robot].strip():
                self._changed[robot] = f"the description of {robot} has changed; restart the node"
                self._node.get_logger().error(self._changed[robot])
                self._on_change()
            return
        try:
            block = load_robot(robot, {**self._values[robot], "urdf_text": message.data})
            block.build(robot)
        except ScenarioError as error:
            if error.key != f"{robot}.urdf":
                raise
            text = f"rejected the description of {robot} on {topic}: found {error.found}"
            self._rejected[robot] = text
            self._node.get_logger().error(text)
            return
        self._rejected.pop(robot, None)
        self._texts[robot] = message.data
