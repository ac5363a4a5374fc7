# SPDX-License-Identifier: Apache-2.0
"""Programs of `test_delivery.py`: a reader, and a writer that overruns it.

`overrun.py read` prints how many messages it has received when its publisher has ended.
`overrun.py write PID` publishes `COUNT` messages, most of them while that reader is stopped, and
ends when all are acknowledged, or after `ACK_TIMEOUT`.
"""

import os
import signal
import sys
import time

import rclpy
from rclpy.duration import Duration
from rclpy.node import Node
from std_msgs.msg import String

from noninteract_ros.nodes.common.guarded_node import LOOP_QOS
from noninteract_ros.nodes.common.program import run_program
from noninteract_ros.nodes.recording.raw_subscription import RawSubscription

TOPIC = "/overrun"
COUNT = 900
SIZE = 600  # bytes; together they do not fit into a socket buffer
PERIOD = 0.001  # [s]
TIMEOUT = 20.0  # [s]
ACK_TIMEOUT = 1.5  # [s] many heartbeats, and half of the default heartbeat period


class Writer(Node):
    """Node that publishes continuously and then ends."""

    handles_shutdown = False

    def __init__(self) -> None:
        super().__init__("writer")
        self._reader = int(sys.argv.pop())
        self._publisher = self.create_publisher(String, TOPIC, LOOP_QOS)

    def run(self) -> None:
        """Wait for the reader, then publish all messages."""
        end = time.monotonic() + TIMEOUT
        while not self._publisher.get_subscription_count() and time.monotonic() < end:
            time.sleep(0.05)
        for number in range(COUNT):
            if number == COUNT // 4:
                os.kill(self._reader, signal.SIGSTOP)
            self._publisher.publish(String(data="x" * SIZE))
            time.sleep(PERIOD)
        os.kill(self._reader, signal.SIGCONT)
        self._publisher.wait_for_all_acked(Duration(seconds=ACK_TIMEOUT))


def read() -> None:
    """Read until the publisher has ended."""
    rclpy.init()
    node = Node("reader")
    feed = RawSubscription(node, TOPIC, "std_msgs/msg/String")
    count = 0
    end = time.monotonic() + TIMEOUT
    while time.monotonic() < end and (not count or node.count_publishers(TOPIC)):
        count += feed.drain(lambda *_: None)
        time.sleep(0.002)
    print(count + feed.drain(lambda *_: None))


if __name__ == "__main__":
    if sys.argv[1] == "read":
        read()
    else:
        sys.exit(run_program(Writer, []))
