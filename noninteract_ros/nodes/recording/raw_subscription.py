# SPDX-License-Identifier: Apache-2.0
"""Raw subscription without an executor, with a count of lost messages."""

import importlib
import time
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from noninteract_ros.errors import InputError

QUEUE_DEPTH = 5000  # five seconds of a 1 kHz topic
BATCH_SIZE = 1000  # messages at a time, so that one topic cannot starve the others

# Topic, type, times of reception and publication [ns], serialized message, sequence number.
Store = Callable[[str, str, int, int, bytes, int], None]


class SequenceCheck:
    """Detector of gaps in the sequence numbers of one topic.

    A message does not identify its publisher, so that numbers are matched with those expected
    next: exact with one publisher on the topic, a close estimate with more.

    Args:
        publishers: Returns the current number of publishers of the topic.

    Attributes:
        lost: Number of messages that were sent to this subscription and never arrived.
        missed: Number of messages that were sent before this subscription matched.
    """

    def __init__(self, publishers: Callable[[], int]) -> None:
        self._publishers = publishers
        self._expected: list[int] = []  # One for each publisher, in the order of reception.
        self.lost = 0
        self.missed = 0

    def update(self, number: int) -> None:
        """Process the sequence number of a received message."""
        if number in self._expected:
            self._expected.remove(number)
        else:
            self._handle_gap(number)
        self._expected.append(number + 1)

    def _handle_gap(self, number: int) -> None:
        before = [expected for expected in self._expected if expected < number]
        publishers = max(1, self._publishers())
        if before and len(self._expected) >= publishers:
            self.lost += number - max(before)
            self._expected.remove(max(before))
        else:
            self.missed += number - 1
            # A new publisher may replace one that has ended.
            del self._expected[: max(0, len(self._expected) - publishers + 1)]


class RawSubscription:
    """Raw subscription that is polled, at about a quarter of an executor's cost.

    Args:
        node: Node that subscribes.
        topic: Fully qualified name of the topic.
        type_name: Type of its messages, such as `sensor_msgs/msg/JointState`.

    Attributes:
        sequence: Count of lost messages.
        longest_wait: Longest time between reception and `drain` of a message [s]. It grows when
            this process is overloaded, before messages are lost.

    Raises:
        InputError: The message type is not installed.
    """

    def __init__(self, node: Node, topic: str, type_name: str) -> None:
        self.topic, self.type_name = topic, type_name
        self.sequence = SequenceCheck(lambda: node.count_publishers(topic))
        self.longest_wait = 0.0
        self._node = node
        self._type = message_type(type_name)
        self._reliability = ReliabilityPolicy.RELIABLE
        self._durability = DurabilityPolicy.VOLATILE
        self._subscription = self._subscribe()

    def match_publishers(self) -> None:
        """Adapt the QoS to the publishers and subscribe again if it has changed.

        The reliability is best effort where a publisher offers no more, else nothing of it would
        arrive. The durability is transient local where all publishers offer it.
        """
        best_effort, latched = ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.TRANSIENT_LOCAL
        before = (self._reliability, self._durability)
        offers = [
            offer.qos_profile for offer in self._node.get_publishers_info_by_topic(self.topic)
        ]
        if any(offer.reliability == best_effort for offer in offers):
            self._reliability = best_effort
        if offers:
            all_latched = all(offer.durability == latched for offer in offers)
            self._durability = latched if all_latched else DurabilityPolicy.VOLATILE
        if before != (self._reliability, self._durability):
            self._node.destroy_subscription(self._subscription)
            self._subscription = self._subscribe()

    def drain(self, store: Store) -> int:
        """Pass received messages to `store`, at most `BATCH_SIZE`; return their number."""
        taken = 0
        handle = self._subscription.handle
        with handle:
            while taken < BATCH_SIZE and (found := handle.take_message(self._type, True)):
                data, info = found
                self._store(store, data, info)
                taken += 1
        return taken

    def _store(self, store: Store, data: bytes, info: dict[str, Any]) -> None:
        now = time.time_ns()
        # Middleware without these times reports zero.
        received = info["received_timestamp"] or now
        sent = info["source_timestamp"] or received
        number = info["publication_sequence_number"] or 0
        if number:
            self.sequence.update(number)
        self.longest_wait = max(self.longest_wait, (now - received) * 1e-9)
        store(self.topic, self.type_name, received, sent, data, number)

    def _subscribe(self) -> Any:
        qos = QoSProfile(
            depth=QUEUE_DEPTH, reliability=self._reliability, durability=self._durability
        )
        return self._node.create_subscription(self._type, self.topic, _unused, qos, raw=True)


def message_type(type_name: str) -> type:
    """Return the Python class of a message type.

    Raises:
        InputError: The type is not installed.
    """
    try:
        package, kind, name = type_name.split("/")
        found = getattr(importlib.import_module(f"{package}.{kind}"), name)
    except (ValueError, ImportError, AttributeError) as error:
        raise InputError(f"message type {type_name} is not installed ({error})") from error
    if not isinstance(found, type) or kind != "msg":
        raise InputError(f"{type_name} is not a message type")
    return found


def _unused(message: bytes) -> None:
    """Satisfy the subscription, which requires a callback; no executor calls it."""
