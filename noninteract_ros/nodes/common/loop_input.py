# SPDX-License-Identifier: Apache-2.0
"""Input of a loop in wall time: the newest message of one publisher."""

from collections.abc import Callable

from noninteract_ros.errors import InputError
from noninteract_ros.nodes.common.loop_subscription import LoopSubscription
from noninteract_ros.nodes.common.node import ScenarioNode
from noninteract_ros.nodes.common.publisher_binding import PublisherBinding


class LoopInput:
    """Topic polled by the thread of a loop, bound to one publisher.

    Args:
        node: Node that subscribes.
        message_type: Message type.
        topic: Topic name.
    """

    def __init__(self, node: ScenarioNode, message_type: type, topic: str) -> None:
        self._node, self._topic = node, topic
        self._subscription = LoopSubscription(node, message_type, topic)
        self._binding = PublisherBinding(node, self._subscription.topic)
        self._publishers = 0
        node.loop_inputs.append(self)

    def wait(self, timeout: float) -> None:
        """Wait for a message, at most `timeout` [s]."""
        self._subscription.wait(timeout)

    def poll(self, receive: Callable[[bytes], None]) -> None:
        """Pass the newest message of the bound publisher on; reject those of others.

        Args:
            receive: Called with the serialized message; an InputError rejects it.
        """
        publishers = self._subscription.publishers()
        if publishers != self._publishers:
            self._publishers = publishers
            self._binding.refresh()
        newest, others = self._binding.select(self._subscription.take())
        if others:
            text = f"{others} messages of a second publisher"
            self._node.reject_input(self._topic, text)
        if newest is None:
            return
        try:
            receive(newest.data)
        except InputError as error:
            self._node.reject_input(self._topic, str(error))

    def refresh(self) -> None:
        """Read the publishers of the topic from the graph."""
        self._binding.refresh()

    def problem(self) -> str:
        """Return the error text of a topic with several publishers, or ""."""
        return self._binding.problem()

    def destroy(self) -> None:
        """Destroy the subscription."""
        self._subscription.destroy()
