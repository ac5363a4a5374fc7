# SPDX-License-Identifier: Apache-2.0
"""What programs that were killed have left behind in shared memory."""

import fcntl
import re
import time
from pathlib import Path

SHARED_MEMORY = Path("/dev/shm")
LOCK = re.compile(r"(fastrtps_[0-9a-f]{16})_el")
YOUNG = 60.0  # [s] before this age the program that owns a segment may not hold its lock yet


def remove_abandoned(folder: Path = SHARED_MEMORY) -> int:
    """Removes segments of Fast DDS whose owners have ended without doing so, half a MB each.

    An owner holds a lock on a file of its own beside the segment for as long as it lives.

    Returns:
        How many were removed.
    """
    removed = 0
    for lock in folder.glob("fastrtps_*_el"):
        found = LOCK.fullmatch(lock.name)
        try:
            if found is None or time.time() - lock.stat().st_mtime < YOUNG:
                continue
            with lock.open() as file:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                (folder / found[1]).unlink(missing_ok=True)
                lock.unlink()
        except OSError:  # Its owner lives, or it is somebody else's.
            continue
        removed += 1
    return removed
