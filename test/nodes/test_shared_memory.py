# SPDX-License-Identifier: Apache-2.0
"""Removal of shared memory segments left by killed programs."""

import fcntl
import os
import time
from pathlib import Path

from noninteract_ros.nodes.stack.shared_memory import MIN_AGE, remove_abandoned


def segment(folder: Path, name: str, age: float) -> Path:
    """Create a segment and its lock with an age [s]; return the lock."""
    lock = folder / f"{name}_el"
    (folder / name).touch()
    lock.touch()
    os.utime(lock, (time.time() - age,) * 2)
    return lock


def test_only_segments_without_an_owner_are_removed(tmp_path: Path) -> None:
    """Segments that are locked, young, or of another kind stay."""
    old = 10 * MIN_AGE
    segment(tmp_path, "fastrtps_0123456789abcdef", old)
    held = segment(tmp_path, "fastrtps_0123456789abcde0", old)
    segment(tmp_path, "fastrtps_0123456789abcde1", 0.0)
    segment(tmp_path, "fastrtps_port7411", old)
    segment(tmp_path, "others", old)
    before = {file.name for file in tmp_path.iterdir()}
    with held.open() as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        assert remove_abandoned(tmp_path) == 1
    gone = before - {file.name for file in tmp_path.iterdir()}
    assert gone == {"fastrtps_0123456789abcdef", "fastrtps_0123456789abcdef_el"}
    assert remove_abandoned(tmp_path / "nowhere") == 0
