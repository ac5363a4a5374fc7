# SPDX-License-Identifier: Apache-2.0
"""Removal of shared memory that killed programs have left behind."""

import fcntl
import re
import time
from pathlib import Path

SHARED_MEMORY = Path("/dev/shm")
LOCK = re.compile(r"(fastrtps_[0-9a-f]{16})_el")
MIN_AGE = 60.0  # [s] below which the owner of a segment may not have locked it yet


def remove_abandoned(folder: Path = SHARED_MEMORY) -> int:
    """Remove Fast DDS segments, half a MB each, whose owners have ended.

    An owner holds the lock of a file beside its segment for its whole lifetime.

    Returns:
        Number of removed segments.
    """
    removed = 0
    for lock in folder.glob("fastrtps_*_el"):
        found = LOCK.fullmatch(lock.name)
        try:
            if found is None or time.time() - lock.stat().st_mtime < MIN_AGE:
                continue
            with lock.open() as file:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                (folder / found[1]).unlink(missing_ok=True)
                lock.unlink()
        except OSError:  # The owner is running, or the file belongs to another user.
            continue
        removed += 1
    return removed
