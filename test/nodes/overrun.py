# SPDX-License-Identifier: Apache-2.0
"""Programs of `test_delivery.py`: one that reads, and one that speaks faster than it can.

`overrun.py read` prints how many messages it had when its publisher was gone. `overrun.py write
PID` says `COUNT` messages, most of them while it has stopped that reader, and ends when the reader
has them, or soon.
"""

import os
import signal
import sys
import time

import rclpy
from rclpy.duration import Duration
from rclpy.node import Node
from std_msgs.msg import String

from noninteract_ros.nodes.common.node import LOOP_QOS
from noninteract_ros.nodes.common.program import run_program
from noninteract_ros.nodes.recording.raw_subscription import RawSubscription

TOPIC = "/overrun"
COUNT = 900
SIZE = 600  # bytes; so many of them do not fit into the buffer of a socket
PERIOD = 0.001  # [s]
PATIENCE = 20.0  # [s]
SOON = 1.5  # [s] many heartbeats, and half of what one takes by default


class Writer(Node):
    """Speaks without a pause, and leaves soon."""

    handles_shutdown = False

    def __init__(self) -> None:
        super().__init__("writer")
        self._reader = int(sys.argv.pop())
        self._to = self.create_publisher(String, TOPIC, LOOP_QOS)

    def run(self) -> None:
        """Waits for its reader, then says everything."""
        end = time.monotonic() + PATIENCE
        while not self._to.get_subscription_count() and time.monotonic() < end:
            time.sleep(0.05)
        for number in range(COUNT):
            if number == COUNT // 4:
                os.kill(self._reader, signal.SIGSTOP)
            self._to.publish(String(data="x" * SIZE))
            time.sleep(PERIOD)
        os.kill(self._reader, signal.SIGCONT)
        self._to.wait_for_all_acked(Duration(seconds=SOON))


def read() -> None:
    """Reads until its publisher is gone."""
    rclpy.init()
    node = Node("reader")
    feed = RawSubscription(node, TOPIC, "std_msgs/msg/String")
    heard = 0
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end and (not heard or node.count_publishers(TOPIC)):
        heard += feed.drain(lambda *_: None)
        time.sleep(0.002)
    print(heard + feed.drain(lambda *_: None))


if __name__ == "__main__":
    if sys.argv[1] == "read":
        read()
    else:
        sys.exit(run_program(Writer, []))
