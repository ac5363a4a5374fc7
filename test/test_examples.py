# SPDX-License-Identifier: Apache-2.0
"""The examples and the README's Python run as they stand, without ROS."""

import os
import re
import subprocess
import sys
from functools import cache
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from repository import ROOT

DEADLINE = 180.0  # s; on a busy machine
ALL = sorted((ROOT / "examples").glob("*.py"))
EXAMPLES = [script for script in ALL if "import rclpy" not in script.read_text(encoding="utf-8")]
FENCED_PYTHON = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
README_CODE = FENCED_PYTHON.findall((ROOT / "README.md").read_text(encoding="utf-8"))
# A module that is None cannot be imported.
WITHOUT_ROS = """
import runpy, sys
sys.modules["rclpy"] = None
runpy.run_path(sys.argv[1], run_name="__main__")
"""


@cache
def run(script: Path) -> str:
    """Runs a script in an empty folder with rclpy out of reach; returns what it printed."""
    with TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, "-c", WITHOUT_ROS, str(script)],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"},
            capture_output=True,
            text=True,
            check=False,
            timeout=DEADLINE,
        )
    assert done.returncode == 0, done.stderr
    return done.stdout


def numbers(text: str) -> list[float]:
    """All numbers in a text, in order."""
    return [float(found) for found in re.findall(r"[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?", text)]


@pytest.mark.parametrize("script", EXAMPLES, ids=lambda script: script.stem)
def test_example_runs_without_ros(script: Path) -> None:
    """Every example ends well and prints something."""
    assert run(script).strip()


def test_readme_shows_the_law_in_under_20_lines(tmp_path: Path) -> None:
    """The README's Python is short, is that of the example, and leads the team to its goal."""
    assert len(README_CODE) == 1
    assert len(README_CODE[0].splitlines()) < 20
    assert README_CODE[0] in (ROOT / "examples" / "notebook_law.py").read_text(encoding="utf-8")
    script = tmp_path / "readme.py"
    script.write_text(README_CODE[0], encoding="utf-8")
    assert numbers(run(script))[:4] == [1.0, 0.5, 1.0, 0.0]


def test_the_door_is_what_the_documents_warn_of() -> None:
    """`noninteracting` is unstable at the passive door, `natural` is not; both are alone."""
    lines = run(ROOT / "examples" / "door_eigenvalue.py").splitlines()[1:]
    free, decoupled, natural = (numbers(line)[0] for line in lines)
    assert free < 0.0
    assert decoupled == pytest.approx(17.76, abs=0.01)
    assert natural < 0.0


def test_the_human_moves_the_formation_only_under_the_natural_law() -> None:
    """What crosses over is centimetres under `natural` and rounding under `noninteracting`."""
    lines = run(ROOT / "examples" / "noninteraction.py").splitlines()[-2:]
    natural, noninteracting = (numbers(line)[0] for line in lines)
    assert natural > 0.01
    assert noninteracting < 1e-12


def test_the_paper_without_ros_meets_its_closed_form_in_order_1() -> None:
    """Below 2 mm at 1 kHz, halved when the rate doubles, with storages that are not negative."""
    printed = run(ROOT / "examples" / "paper_without_ros.py")
    rows = [numbers(line) for line in printed.splitlines()[1:4]]
    for slow, fast in pairwise(rows):
        for column in (1, 2):
            assert slow[column] / fast[column] == pytest.approx(2.0, rel=0.05)
    assert rows[-1][0] == 1000.0
    assert max(rows[-1][1:3]) < 2e-3
    assert min(row[3] for row in rows) >= 0.0


def test_what_states_of_different_times_cost() -> None:
    """In proportion to the age with constant velocity; measured acceleration costs far less."""
    printed = run(ROOT / "examples" / "states_at_different_times.py").splitlines()[1:]
    same, *aged = (numbers(line) for line in printed)
    assert same[1] == same[2] < 1e-6
    for age, constant, accelerated in aged:
        assert constant == pytest.approx(aged[0][1] * age, rel=0.05)
        assert accelerated < 0.02 * constant


def test_what_crosses_over_on_arms_falls_with_the_tick() -> None:
    """Holding the torque over a tick lets micrometres through, half as many at twice the rate."""
    rows = [
        numbers(line) for line in run(ROOT / "examples" / "holding_the_torque.py").splitlines()[1:]
    ]
    for slow, fast in pairwise(rows):
        assert slow[2] / fast[2] == pytest.approx(2.0, rel=0.1)
    assert rows[-1][2] < 1e-5 * rows[-1][1]
