# SPDX-License-Identifier: Apache-2.0
"""YAML of scenario and parameter files: values, and errors in one line."""

from pathlib import Path

import numpy as np
import pytest

from noninteract_ros.errors import ScenarioError
from noninteract_ros.nodes.common.parameter_files import rewrite
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import load_scenario, parameters_of, read_parameters
from noninteract_ros.scenario.yaml_text import YamlTextError, parse_yaml

CONFIG = Path(__file__).resolve().parents[2] / "config"
PAPER = (CONFIG / "paper.yaml").read_text()


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e3", 1000.0),
        ("1.0e3", 1000.0),
        ("5e-1", 0.5),
        ("-2E+1", -20.0),
        ("[2e1, 2e1]", [20.0, 20.0]),
        ("e3", "e3"),
        ("'1e3'", "1e3"),
        ("1.2.3", "1.2.3"),
        ("12", 12),
        ("1:30", "1:30"),
        ("2026-01-31", "2026-01-31"),
        ("[]", []),
        ("true", True),
        ("~", None),
    ],
)
def test_values(text, value):
    """Numbers may have an exponent without a point; dates and times are texts."""
    found = parse_yaml(f"a: {text}")["a"]
    assert (found, type(found)) == (value, type(value))


def test_keys_are_texts():
    """`no` and `1` are names, in blocks and in merged anchors."""
    assert parse_yaml("no: 1\n1: {on: 2}") == {"no": 1, "1": {"on": 2}}
    assert parse_yaml("a: &a {x: 1, y: 1}\nb: {<<: *a, y: 2}")["b"] == {"x": 1, "y": 2}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a: 1\nb: 2\na: 3", "line 3: key 'a' is given twice, first in line 1"),
        ("a: {x: 1,\n x: 2}", "line 2: key 'x' is given twice, first in line 1"),
        ("a: &a [*a]", "line 1: an anchor that contains itself"),
        ("a: &a {b: *a}", "line 1: an anchor that contains itself"),
        ("a: " + "[" * 10000, "line 1: more than 32 levels"),
        ("? [1]\n: 2", "line 1: a key that is no text"),
        ("a: !!binary abc", "line 1: could not determine a constructor"),
        ('a: "\\ud800"', "line 1: a text with characters"),
        ('a: "\\0"', "line 1: a text with characters"),
        ("a: b: c", "line 1: mapping values are not allowed here"),
    ],
)
def test_errors(text, words):
    """An error is one short line with the line in the text."""
    with pytest.raises(YamlTextError) as caught:
        parse_yaml(text)
    assert str(caught.value).startswith(words)
    assert len(str(caught.value)) < 200


def test_copies_of_anchors_count():
    """A text of a few lines cannot stand for a billion values."""
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 10)]
    with pytest.raises(YamlTextError, match="more than 200000 values"):
        parse_yaml("\n".join(lines))


@pytest.mark.parametrize(
    ("old", "new", "error"),
    [
        ("rate: 1000.0", "rate: 1e3", None),
        ("rate: 1000.0", "rate: " + "9" * 400, "rate: found inf"),
        ("rate: 1000.0", "rate: " + "9" * 5000, "rate: found inf"),
        ("mass: 2.0", "mass: 1e300", "robot_2.mass: found 1e+300"),
        ("mass: 2.0", f"mass: [{', '.join(['1'] * 9999)}]", "robot_2.mass: found [1, 1"),
        ("robot_2", "no", "robots: found ['robot_1', False]"),
        ("robot_2", "'1'", "robots: found '1'"),
        ("robot_2", "r" * 65, "robots: found 'rrr"),
        (
            "    subtasks: [",
            "    robots: [a]\n    subtasks: [",
            "(file): found line 18: key 'robots'",
        ),
        (
            "    lockstep: true",
            "    tank.reserve: 1.0\n    tank: {reserve: 1.0}",
            "tank.reserve: found the key twice",
        ),
        ("ros__parameters:", "ros__parameters: []\n  x:", "/**.ros__parameters: found []"),
        ("ros__parameters:", "ros__parameters:\n  x:", "/**.ros__parameters: found nothing"),
    ],
)
def test_scenarios(tmp_path, old, new, error):
    """A scenario file is read with these rules; an error names file and key in a short line."""
    file = tmp_path / "a: b #2.yaml"
    assert old in PAPER
    file.write_text(PAPER.replace(old, new))
    if error is None:
        assert load_scenario(file).general.rate == 1000.0
        return
    with pytest.raises(ScenarioError) as caught:
        load_scenario(file)
    assert str(caught.value).startswith(f"{file}: {error}")
    assert len(str(caught.value)) < 1500


def test_numbers_with_which_linear_algebra_fails(monkeypatch):
    """An error of numpy or Pinocchio is an error of the scenario, not a traceback."""

    def fail(self):
        raise np.linalg.LinAlgError("Singular matrix")

    monkeypatch.setattr(Scenario, "__post_init__", fail)
    with pytest.raises(ScenarioError, match="LinAlgError: Singular matrix") as caught:
        load_scenario(CONFIG / "paper.yaml")
    assert caught.value.key == "(scenario)"


def test_blocks_of_several_nodes_are_merged_by_key():
    """As in ROS, the block of a node changes single keys of `/**`."""
    content = {
        "/**": {"ros__parameters": {"tank": {"reserve": 1.0, "initial": 2.0}}},
        "controller": {"ros__parameters": {"tank.reserve": 3.0}},
    }
    assert parameters_of(content) == {"tank": {"reserve": 3.0, "initial": 2.0}}


def test_programs_read_the_same_values(tmp_path):
    """Parameter files and overrides go through the same reader before ROS parses them."""
    file = tmp_path / "in.yaml"
    file.write_text(
        PAPER.replace("rate: 1000.0", "rate: 1e3\n    lockstep_sources: []", 1).replace(
            "    lockstep_sources: [cooperative/human, relative/autonomy]\n", ""
        )
    )
    arguments = ["--params-file", str(file), "-p", "output:=trial #2: 1e3", "-p", "pushes:=[]"]
    written = rewrite(["", *arguments], tmp_path)
    values = read_parameters(Path(written[2]))
    assert (values["rate"], values["lockstep_sources"]) == (1000.0, [""])
    assert written[3:] == ["-p", 'output:="trial #2: 1e3"', "-p", 'pushes:=[""]']
