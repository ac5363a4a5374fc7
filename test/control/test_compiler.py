# SPDX-License-Identifier: Apache-2.0
"""Machine code is cached for the next process, until its sources change."""

import shutil
import subprocess
import sys
from pathlib import Path

from noninteract_ros import compiler

INNER = "from compiler import inner\n\n@inner\ndef value():\n    return {}\n"
OUTER = (
    "from compiler import compiled\nfrom inside import value\n\n"
    "@compiled\ndef doubled():\n    return 2 * value()\n"
)
ASK = "from outside import doubled; print(doubled(), *doubled.stats.cache_hits.values())"


def answer(folder: Path) -> list[int]:
    """Result of the compiled function, and 1 for each cache hit."""
    command = [sys.executable, "-c", ASK]
    run = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    return [int(word) for word in run.stdout.split()]


def test_code_is_cached_until_what_it_calls_changes(tmp_path: Path) -> None:
    """A change in the file of an inner function invalidates the cached code of its caller."""
    shutil.copy(Path(str(compiler.__file__)), tmp_path / "compiler.py")
    (tmp_path / "outside.py").write_text(OUTER)
    (tmp_path / "inside.py").write_text(INNER.format(1))
    assert answer(tmp_path) == [2]
    assert answer(tmp_path) == [2, 1]
    (tmp_path / "inside.py").write_text(INNER.format(5))
    assert answer(tmp_path) == [10]


def test_a_full_disk_costs_only_time(tmp_path: Path) -> None:
    """If machine code cannot be saved, the process continues with the compiled function."""
    shutil.copy(Path(str(compiler.__file__)), tmp_path / "compiler.py")
    (tmp_path / "outside.py").write_text(OUTER)
    (tmp_path / "inside.py").write_text(INNER.format(1))
    full = "def full(*a): raise OSError(28, 'No space left on device')\n"
    full += "import numba.core.caching as c; c.IndexDataCacheFile.save = full\n"
    command = [sys.executable, "-c", full + ASK]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert (run.returncode, run.stdout.split()) == (0, ["2"]), run.stderr
