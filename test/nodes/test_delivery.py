# SPDX-License-Identifier: Apache-2.0
"""Retransmission of messages dropped by a full socket buffer."""

import os
import subprocess
import sys
from pathlib import Path

from overrun import COUNT, TIMEOUT

PROGRAM = str(Path(__file__).parent / "overrun.py")


def test_dropped_messages_are_sent_again_at_the_next_heartbeat(domain: int) -> None:
    """The reader is stopped while messages are published, and the writer ends soon after."""
    own = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    environment = os.environ | own
    with subprocess.Popen(
        [sys.executable, PROGRAM, "read"], stdout=subprocess.PIPE, text=True, env=environment
    ) as reader:
        writer = [sys.executable, PROGRAM, "write", str(reader.pid)]
        try:
            subprocess.run(writer, env=environment, check=True, timeout=3 * TIMEOUT)
            count, _ = reader.communicate(timeout=3 * TIMEOUT)
        finally:
            reader.kill()
    assert int(count) == COUNT
