# SPDX-License-Identifier: Apache-2.0
"""Binding of a topic to one publisher."""

import threading
import time
from collections.abc import Sequence

from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

from noninteract_ros.nodes.common.loop_subscription import GID_SIZE, Received

TAKE_OVER_SILENCE = 1.0  # [s] of the bound publisher, after which another one may replace it
REFRESH_PERIOD = 0.1  # [s] minimum time between readings of the graph in the loop
UNKNOWN = "an unknown node"


class PublisherBinding:
    """Binding of a topic to the one publisher whose messages are applied.

    The first publisher that sends a message is bound. It is released when it leaves the graph, or
    when it has been silent for `TAKE_OVER_SILENCE` while another one sends, as after a restart of
    a program that was killed, which the graph shows for some time. While there is a second
    publisher otherwise, `problem` names both nodes.

    Args:
        node: Node that subscribes.
        topic: Fully qualified name of the topic.
    """

    def __init__(self, node: Node, topic: str) -> None:
        self._node, self._topic = node, topic
        self._lock = threading.Lock()
        self._names: dict[bytes, str] = {}
        self._received_at: dict[bytes, float] = {}
        self._replaced: dict[bytes, float] = {}  # Monotonic times at which they were replaced.
        self._refreshed_at = -float("inf")
        self.bound: bytes | None = None

    def select(self, messages: Sequence[Received]) -> tuple[Received | None, int]:
        """Return the newest message of the bound publisher and the number of those of others."""
        now = time.monotonic()
        newest, others = None, 0
        for message in messages:
            self._received_at[message.gid] = now
            if message.gid not in self._names and now - self._refreshed_at > REFRESH_PERIOD:
                self.refresh()
            if self._is_bound(message.gid, now):
                newest = message
            else:
                others += 1
        return newest, others

    def _is_bound(self, gid: bytes, now: float) -> bool:
        if gid == self.bound:
            return True
        with self._lock:
            if self.bound is not None:
                if now - self._received_at.get(self.bound, -float("inf")) < TAKE_OVER_SILENCE:
                    return False
                self._replaced[self.bound] = now
            self._replaced.pop(gid, None)
            self.bound = gid
        return True

    def refresh(self) -> None:
        """Read the publishers of the topic from the graph."""
        found = self._node.get_publishers_info_by_topic(self._topic)
        names = {bytes(item.endpoint_gid[:GID_SIZE]): _full_name(item) for item in found}
        with self._lock:
            self._names, self._refreshed_at = names, time.monotonic()
            self._replaced = {gid: at for gid, at in self._replaced.items() if gid in names}
            if self.bound is not None and self.bound not in names:
                silence = self._refreshed_at - self._received_at.get(self.bound, -float("inf"))
                if silence >= REFRESH_PERIOD:
                    self.bound = None
            limit = self._refreshed_at - TAKE_OVER_SILENCE
            self._received_at = {
                gid: at for gid, at in self._received_at.items() if gid in names or at > limit
            }

    def problem(self) -> str:
        """Return the error text of a topic with several publishers, or ""."""
        with self._lock:
            rivals = {
                gid
                for gid in self._names.keys() | self._received_at.keys()
                if gid not in self._replaced
                or self._received_at.get(gid, -float("inf")) > self._replaced[gid]
            }
            if len(rivals) < 2:
                return ""
            names = [self._names.get(gid, UNKNOWN) for gid in rivals]
        return f"{self._topic} has {len(names)} publishers: {', '.join(sorted(names))}"


class PublisherWatch:
    """Report of a second publisher of a topic, in lockstep, where only simulated robots move.

    Args:
        node: Node that subscribes.
        topic: Topic name.
    """

    def __init__(self, node: Node, topic: str) -> None:
        self._node, self._topic = node, node.resolve_topic_name(topic)
        self._names: list[str] = []

    def refresh(self) -> None:
        """Read the publishers of the topic from the graph."""
        if self._node.count_publishers(self._topic) < 2:
            self._names = []
            return
        found = self._node.get_publishers_info_by_topic(self._topic)
        self._names = sorted(_full_name(item) for item in found)

    def problem(self) -> str:
        """Return the error text of a topic with several publishers, or ""."""
        if len(self._names) < 2:
            return ""
        return f"{self._topic} has {len(self._names)} publishers: {', '.join(self._names)}"


def _full_name(publisher: TopicEndpointInfo) -> str:
    return f"{publisher.node_namespace.rstrip('/')}/{publisher.node_name}"
