# SPDX-License-Identifier: Apache-2.0
"""URDFs that come on topics, as robot_state_publisher offers them."""

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any

from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from noninteract_ros.errors import ScenarioError
from noninteract_ros.scenario.blocks import description_topics, load_robot

# What is said once and holds: who comes later hears it too.
LATCHED_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TELL_PERIOD = 0.5  # [s] between diagnostics while a node waits
LOG_PERIOD = 5.0  # [s] between lines of its log

Tell = Callable[[str, bool], None]


class Descriptions:
    """The robots' descriptions that a scenario leaves to topics.

    A description that is no URDF is refused, and a better one is waited for. Once all are there,
    they must not change: what runs was built from them.

    Args:
        node: Node that subscribes.
        values: Nested values of a scenario.
        on_change: Called where a description changes.

    """

    def __init__(
        self, node: Node, values: Mapping[str, Any], on_change: Callable[[], None]
    ) -> None:
        self._node, self._values, self._on_change = node, values, on_change
        self._texts: dict[str, str] = {}
        self._complete = False
        self._refused: dict[str, str] = {}
        self._changed: dict[str, str] = {}
        self._topics = description_topics(values)
        for robot, topic in self._topics.items():
            take = partial(self._take, robot, topic)
            node.create_subscription(String, topic, take, LATCHED_QOS)

    def wait(self, tell: Tell, timeout: float = float("inf")) -> dict[str, Any]:
        """Waits for all descriptions, by an executor of its own.

        Args:
            tell: Told every now and then what is waited for, and whether something was refused.
            timeout: After which it gives up [s].

        Returns:
            The scenario's values, with the texts in place.

        Raises:
            ScenarioError: The scenario does not fit a description, or the time is over.
            ExternalShutdownException: The context was shut down.
        """
        executor = SingleThreadedExecutor(context=self._node.context)
        executor.add_node(self._node)
        end, told_at, logged_at = time.monotonic() + timeout, -TELL_PERIOD, -LOG_PERIOD
        try:
            while missing := [name for name in self._topics if name not in self._texts]:
                now = time.monotonic()
                text = self.problem or self._missing_text(missing)
                if now > end:
                    key = f"{missing[0]}.urdf"
                    raise ScenarioError(key, self._topics[missing[0]], f"a URDF there: {text}")
                if now - told_at >= TELL_PERIOD:
                    tell(text, bool(self.problem))
                    told_at = now
                if now - logged_at >= LOG_PERIOD:
                    self._node.get_logger().info(text)
                    logged_at = now
                executor.spin_once(timeout_sec=0.1)
        finally:
            with suppress(ExternalShutdownException):
                executor.remove_node(self._node)
                executor.shutdown(0.5)
        self._complete = True
        return {name: self._filled(name, block) for name, block in self._values.items()}

    @property
    def problem(self) -> str:
        """What is wrong with descriptions, or an empty text; a change is not taken back."""
        return "; ".join([*self._refused.values(), *self._changed.values()])

    def heard_on(self, topic: str) -> bool:
        """Whether a description comes on a topic."""
        resolve = self._node.resolve_topic_name
        return resolve(topic) in map(resolve, self._topics.values())

    def _missing_text(self, missing: list[str]) -> str:
        topics = (self._node.resolve_topic_name(self._topics[name]) for name in missing)
        named = (f"{name} on {topic}" for name, topic in zip(missing, topics, strict=True))
        return f"waiting for the description of {', '.join(named)}"

    def _filled(self, name: str, block: Any) -> Any:
        return block | {"urdf_text": self._texts[name]} if name in self._texts else block

    def _take(self, robot: str, topic: str, message: String) -> None:
        if self._complete:
            if message.data.strip() != self._texts[robot].strip():
                self._changed[robot] = f"the description of {robot} has changed: restart"
                self._node.get_logger().error(self._changed[robot])
                self._on_change()
            return
        try:
            block = load_robot(robot, {**self._values[robot], "urdf_text": message.data})
            block.build(robot)
        except ScenarioError as error:
            if error.key != f"{robot}.urdf":
                raise
            text = f"the description of {robot} on {topic} is refused: found {error.found}"
            self._refused[robot] = text
            self._node.get_logger().error(text)
            return
        self._refused.pop(robot, None)
        self._texts[robot] = message.data
