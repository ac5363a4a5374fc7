# SPDX-License-Identifier: Apache-2.0
"""One topic as raw bytes, taken without an executor, with a count of what did not arrive."""

import importlib
import time
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from noninteract_ros.errors import InputError

DEPTH = 5000  # five seconds of a 1 kHz topic
BATCH = 1000  # messages at a time, so that one topic cannot starve the others

Store = Callable[[str, str, int, int, bytes, int], None]


class SequenceCheck:
    """Finds gaps in the numbers that publishers give their messages on one topic.

    A message does not tell its publisher, so numbers are matched with those expected next: exact
    with one publisher on the topic, a close estimate with more.

    Args:
        publishers: Returns how many publishers the topic has now.

    Attributes:
        lost: Messages that were sent to this reader and never arrived.
        late: Messages that their publishers sent before this reader was there.
    """

    def __init__(self, publishers: Callable[[], int]) -> None:
        self._publishers = publishers
        self._expected: list[int] = []  # one for each publisher, the latest heard last
        self.lost = 0
        self.late = 0

    def note(self, number: int) -> None:
        """Takes the number of the message that came."""
        if number in self._expected:
            self._expected.remove(number)
        else:
            self._jump(number)
        self._expected.append(number + 1)

    def _jump(self, number: int) -> None:
        before = [expected for expected in self._expected if expected < number]
        publishers = max(1, self._publishers())
        if before and len(self._expected) >= publishers:
            self.lost += number - max(before)
            self._expected.remove(max(before))
        else:
            self.late += number - 1
            # Whoever is new may stand in for one that has gone.
            del self._expected[: max(0, len(self._expected) - publishers + 1)]


class RawSubscription:
    """A raw subscription that is emptied by hand: about a quarter of an executor's cost.

    Args:
        node: Node that subscribes.
        topic: Full name.
        type_name: E.g. `sensor_msgs/msg/JointState`.

    Attributes:
        sequence: Count of lost messages.
        longest_wait: Longest time that a message waited to be taken [s]; large where this
            process is overloaded, before anything is lost.

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
        """Asks for less where a publisher offers less: else nothing of it would arrive.

        Where all keep what they said for who comes later, it is asked for.
        """
        best_effort, kept = ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.TRANSIENT_LOCAL
        asked = (self._reliability, self._durability)
        offers = [
            offer.qos_profile for offer in self._node.get_publishers_info_by_topic(self.topic)
        ]
        if any(offer.reliability == best_effort for offer in offers):
            self._reliability = best_effort
        if offers:
            all_kept = all(offer.durability == kept for offer in offers)
            self._durability = kept if all_kept else DurabilityPolicy.VOLATILE
        if asked != (self._reliability, self._durability):
            self._node.destroy_subscription(self._subscription)
            self._subscription = self._subscribe()

    def drain(self, store: Store) -> int:
        """Takes what has arrived and hands it to `store`; returns how many messages."""
        taken = 0
        handle = self._subscription.handle
        with handle:
            while taken < BATCH and (found := handle.take_message(self._type, True)):
                data, info = found
                self._hand_over(store, data, info)
                taken += 1
        return taken

    def _hand_over(self, store: Store, data: bytes, info: dict[str, Any]) -> None:
        now = time.time_ns()
        # Middleware that knows no such times reports zero.
        received = info["received_timestamp"] or now
        sent = info["source_timestamp"] or received
        number = info["publication_sequence_number"] or 0
        if number:
            self.sequence.note(number)
        self.longest_wait = max(self.longest_wait, (now - received) * 1e-9)
        store(self.topic, self.type_name, received, sent, data, number)

    def _subscribe(self) -> Any:
        qos = QoSProfile(depth=DEPTH, reliability=self._reliability, durability=self._durability)
        return self._node.create_subscription(self._type, self.topic, _unused, qos, raw=True)


def message_type(type_name: str) -> type:
    """The Python class of a message type.

    Raises:
        InputError: There is none here.
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
    """Subscriptions must have a callback; no executor ever calls it."""
