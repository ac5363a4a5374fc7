# SPDX-License-Identifier: Apache-2.0
"""Examples and Python code of the README, run without ROS."""

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
    """Run a script in an empty folder without rclpy; return its output."""
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
    """Return all numbers in a text, in order."""
    return [float(found) for found in re.findall(r"[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?", text)]


@pytest.mark.parametrize("script", EXAMPLES, ids=lambda script: script.stem)
def test_example_runs_without_ros(script: Path) -> None:
    """Every example succeeds and prints a result."""
    assert run(script).strip()


def test_readme_shows_the_law_in_under_20_lines(tmp_path: Path) -> None:
    """The README's code is short, is part of the example, and reaches its goal."""
    assert len(README_CODE) == 1
    assert len(README_CODE[0].splitlines()) < 20
    assert README_CODE[0] in (ROOT / "examples" / "notebook_law.py").read_text(encoding="utf-8")
    script = tmp_path / "readme.py"
    script.write_text(README_CODE[0], encoding="utf-8")
    assert numbers(run(script))[:4] == [1.0, 0.5, 1.0, 0.0]


def test_a_passive_door_destabilizes_only_the_noninteracting_law() -> None:
    """`noninteracting` is unstable at the door and stable without; `natural` is stable."""
    lines = run(ROOT / "examples" / "door_eigenvalue.py").splitlines()[1:]
    free, decoupled, natural = (numbers(line)[0] for line in lines)
    assert free < 0.0
    assert decoupled == pytest.approx(17.76, abs=0.01)
    assert natural < 0.0


def test_the_human_moves_the_formation_only_under_the_natural_law() -> None:
    """The coupling is centimetres under `natural` and rounding under `noninteracting`."""
    lines = run(ROOT / "examples" / "noninteraction.py").splitlines()[-2:]
    natural, noninteracting = (numbers(line)[0] for line in lines)
    assert natural > 0.01
    assert noninteracting < 1e-12


def test_the_paper_converges_to_its_closed_form_in_order_1() -> None:
    """The error is below 2 mm at 1 kHz and halves at twice the rate; storages are not negative."""
    printed = run(ROOT / "examples" / "paper_without_ros.py")
    rows = [numbers(line) for line in printed.splitlines()[1:4]]
    for slow, fast in pairwise(rows):
        for column in (1, 2):
            assert slow[column] / fast[column] == pytest.approx(2.0, rel=0.05)
    assert rows[-1][0] == 1000.0
    assert max(rows[-1][1:3]) < 2e-3
    assert min(row[3] for row in rows) >= 0.0


def test_the_error_of_predicted_states() -> None:
    """It is proportional to the age at constant velocity, and far less with accelerations."""
    printed = run(ROOT / "examples" / "states_at_different_times.py").splitlines()[1:]
    same, *aged = (numbers(line) for line in printed)
    assert same[1] == same[2] < 1e-6
    for age, constant, accelerated in aged:
        assert constant == pytest.approx(aged[0][1] * age, rel=0.05)
        assert accelerated < 0.02 * constant


def test_the_coupling_on_arms_is_of_order_1_in_the_tick() -> None:
    """A zero-order hold couples the subtasks by micrometres, half as much at twice the rate."""
    rows = [
        numbers(line) for line in run(ROOT / "examples" / "holding_the_torque.py").splitlines()[1:]
    ]
    for slow, fast in pairwise(rows):
        assert slow[2] / fast[2] == pytest.approx(2.0, rel=0.1)
    assert rows[-1][2] < 1e-5 * rows[-1][1]
