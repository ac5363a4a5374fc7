# SPDX-License-Identifier: Apache-2.0
"""What a full buffer of a socket drops is sent again soon."""

import os
import subprocess
import sys
from pathlib import Path

from overrun import COUNT, PATIENCE

PROGRAM = str(Path(__file__).parent / "overrun.py")


def test_what_a_full_buffer_has_dropped_is_sent_again_at_the_next_heartbeat(domain: int) -> None:
    """A reader stands still while everything is said; whoever said it has gone soon after."""
    own = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    environment = os.environ | own
    with subprocess.Popen(
        [sys.executable, PROGRAM, "read"], stdout=subprocess.PIPE, text=True, env=environment
    ) as reader:
        writer = [sys.executable, PROGRAM, "write", str(reader.pid)]
        try:
            subprocess.run(writer, env=environment, check=True, timeout=3 * PATIENCE)
            heard, _ = reader.communicate(timeout=3 * PATIENCE)
        finally:
            reader.kill()
    assert int(heard) == COUNT
