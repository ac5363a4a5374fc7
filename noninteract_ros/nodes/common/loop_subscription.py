# SPDX-License-Identifier: Apache-2.0
"""Subscription that the thread of a loop polls itself, without an executor.

`rclpy` reports neither in its executors nor in `take_message` which publisher has sent a message,
so messages are taken with the C function that `rclpy` calls too.
"""

import ctypes
import threading
from dataclasses import dataclass
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

# Late messages are worthless. The depth keeps those of one publisher when another one floods.
QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
GID_SIZE = 16
TAKEN = 0  # RCL_RET_OK
MAX_BATCH = 100  # Messages taken at once, so that a flood cannot hold the loop.


class _Allocator(ctypes.Structure):
    """rcutils_allocator_t."""

    _fields_ = [(name, ctypes.c_void_p) for name in ("a", "d", "r", "z", "state")]


class _Buffer(ctypes.Structure):
    """rcl_serialized_message_t."""

    _fields_ = [
        ("data", ctypes.c_void_p),
        ("length", ctypes.c_size_t),
        ("capacity", ctypes.c_size_t),
        ("allocator", _Allocator),
    ]


class _Info(ctypes.Structure):
    """rmw_message_info_t."""

    _fields_ = [
        ("source_timestamp", ctypes.c_int64),
        ("received_timestamp", ctypes.c_int64),
        ("publication_sequence_number", ctypes.c_uint64),
        ("reception_sequence_number", ctypes.c_uint64),
        ("implementation", ctypes.c_void_p),
        ("gid", ctypes.c_uint8 * GID_SIZE),
        ("from_intra_process", ctypes.c_bool),
    ]


# These functions return at once, so the interpreter lock is not released around them.
_rcl, _rcutils = ctypes.PyDLL("librcl.so"), ctypes.PyDLL("librcutils.so")
_take = _rcl.rcl_take_serialized_message
_take.argtypes = [
    ctypes.c_void_p,
    ctypes.POINTER(_Buffer),
    ctypes.POINTER(_Info),
    ctypes.c_void_p,
]
_rcutils.rcutils_get_default_allocator.restype = _Allocator
_rcutils.rcutils_uint8_array_fini.argtypes = [ctypes.POINTER(_Buffer)]


@dataclass(frozen=True, slots=True)
class Received:
    """Serialized message and the id of its publisher.

    Attributes:
        data: Serialized message.
        gid: Globally unique id of the publisher.
    """

    data: bytes
    gid: bytes


class LoopSubscription:
    """Raw subscription for one thread, best effort.

    Args:
        node: Node that subscribes.
        message_type: Message type.
        topic: Topic name.
    """

    def __init__(self, node: Node, message_type: type, topic: str) -> None:
        self._lock, self._destroyed = threading.Lock(), False
        self.topic = node.resolve_topic_name(topic)
        with node.handle:
            # An executor never learns of this subscription.
            self._handle: Any = rclpy_implementation.Subscription(
                node.handle, message_type, self.topic, QOS.get_c_qos_profile()
            )
        self._wait_set: Any = rclpy_implementation.WaitSet(1, 0, 0, 0, 0, 0, node.context.handle)
        self._buffer = _Buffer(None, 0, 0, _rcutils.rcutils_get_default_allocator())
        self._info = _Info()

    def wait(self, timeout: float) -> None:
        """Wait for a message, at most `timeout` [s]."""
        with self._lock:
            if self._destroyed:
                return
            with self._handle, self._wait_set:
                self._wait_set.clear_entities()
                self._wait_set.add_subscription(self._handle)
                self._wait_set.wait(max(0, round(1e9 * timeout)))

    def take(self) -> list[Received]:
        """Return all received messages, at most `MAX_BATCH`, in the order of reception."""
        found: list[Received] = []
        with self._lock:
            if self._destroyed:
                return found
            with self._handle:
                pointer = self._handle.pointer
                while len(found) < MAX_BATCH:
                    if _take(pointer, self._buffer, self._info, None) != TAKEN:
                        break
                    data = ctypes.string_at(self._buffer.data, self._buffer.length)
                    found.append(Received(data=data, gid=bytes(self._info.gid)))
        return found

    def publishers(self) -> int:
        """Return the number of matched publishers."""
        with self._lock:
            if self._destroyed:
                return 0
            with self._handle:
                count: int = self._handle.get_publisher_count()
        return count

    def destroy(self) -> None:
        """Destroy the subscription; the node must still exist."""
        with self._lock:
            self._destroyed = True
            self._wait_set.destroy_when_not_in_use()
            self._handle.destroy_when_not_in_use()
            _rcutils.rcutils_uint8_array_fini(self._buffer)
