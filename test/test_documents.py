# SPDX-License-Identifier: Apache-2.0
"""Documents: what they print is complete, and what they name exists."""

import ast
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import commands
import numpy as np
import pytest
import scenario_reference
import structure
import yaml
from documents import Block, blocks, codes, documents, tables
from harness import merged
from repository import ROOT, programs

from noninteract_ros.control.energy.account import QUANTITIES
from noninteract_ros.control.law.decoupling import LAWS
from noninteract_ros.control.references.subtask_input import AUTHORITIES
from noninteract_ros.control.telemetry.subtask_energies import LABELS
from noninteract_ros.errors import ScenarioError
from noninteract_ros.nodes.recording.recorder import PARAMETERS as RECORDER_PARAMETERS
from noninteract_ros.scenario.files import nest, read_parameters
from noninteract_ros.scenario.scenario import Scenario
from noninteract_ros.schema import key
from noninteract_ros.team.models.urdf_files import read_urdf
from noninteract_ros.validation.check import CheckSettings, run_check

README_LINES = 150
REFERENCE = ROOT / "docs/reference/scenario.md"
ARCHITECTURE = ROOT / "docs/architecture.md"
FOREIGN = ("controller_manager",)  # first keys of parameter files of other packages
# Scenarios that a block of keys may belong to.
BASES = ("paper", "planar_arms", "delayed_wall", "dual_panda")
PANDA = "example-robot-data/panda_description/urdf/panda.urdf"


def named(found: list[Block]) -> Any:
    """Return blocks as parameters of a test, by document and line."""
    return pytest.mark.parametrize("block", found, ids=str)


def is_scenario(block: Block) -> bool:
    """Return True if a YAML block is a whole scenario."""
    return block.text.lstrip().startswith("/**:")


def parameters_of(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the nested parameters of a scenario, with descriptions in the place of topics."""
    values, urdf = nest(content["/**"]["ros__parameters"]), read_urdf("urdf", PANDA)
    for name in values["robots"]:
        if str(values[name].get("urdf", "")).startswith("topic:"):
            values[name]["urdf_text"] = re.sub("panda_(?!desc)", f"{name}_", urdf)
    return values


SCENARIOS = [block for block in blocks("yaml") if is_scenario(block)]
FRAGMENTS = [block for block in blocks("yaml") if not is_scenario(block)]


@named(SCENARIOS)
def test_scenario_passes_its_check(block: Block, tmp_path: Path) -> None:
    """`noninteract check` passes for every scenario that is printed."""
    values = parameters_of(yaml.safe_load(block.text))
    file = tmp_path / "scenario.yaml"
    file.write_text(yaml.safe_dump({"/**": {"ros__parameters": values}}))
    found = run_check(str(file), CheckSettings(None, 0), [])
    failed = [item.name for item in found.checks if item.passed is False]
    assert found.passed, failed


@named(SCENARIOS)
def test_scenario_names_a_law_that_may_be_touched(block: Block) -> None:
    """No printed scenario leads a reader to a law that is not passive at the port."""
    law = parameters_of(yaml.safe_load(block.text)).get("law", LAWS[0])
    assert law in ("energy_gated", "natural")


@named(FRAGMENTS)
def test_keys_belong_to_a_scenario(block: Block) -> None:
    """Every printed block of keys is accepted in one of the package's scenarios."""
    content = yaml.safe_load(block.text)
    if next(iter(content)) in FOREIGN:
        return
    errors = []
    for base in BASES:
        values = read_parameters(ROOT / "config" / f"{base}.yaml")
        values.pop("planner" if "planner" in content else "", None)
        try:
            Scenario.from_dict(merged(values, content))
        except ScenarioError as error:
            errors.append(f"{base}: {error}")
        else:
            return
    pytest.fail("\n".join(errors))


@named(blocks("sh"))
def test_commands_name_what_exists(block: Block) -> None:
    """Targets, subcommands, options, programs, parameters, services, topics, files exist."""
    for command in commands.commands(block.text):
        try:
            commands.check(command)
        except Exception as error:
            pytest.fail(f"{' '.join(command)}: {error!r}")


@named(blocks("python"))
def test_code_runs(block: Block) -> None:
    """Printed Python runs as it stands."""
    run = [sys.executable, "-c", block.text]
    ended = subprocess.run(run, cwd=ROOT, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr


def test_languages_are_known() -> None:
    """Every fenced block is checked by a test, or is plain text."""
    fences = re.compile(r"^ *```(.*)$", re.MULTILINE)
    for file in documents():
        opened = fences.findall(file.read_text())[::2]
        assert set(opened) <= {"sh", "yaml", "python", "text"}, file


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        ("make dem", "no target"),
        ("make demo SCENARIO=papr", "no scenario"),
        ("make demo ARGS='--duratio 6'", "duratio"),
        ("noninteract cheque paper", "no command"),
        ("noninteract check papre", "no scenario"),
        ("ros2 run noninteract_ros controler", "no program"),
        ("ros2 run noninteract_ros controller --ros-args -p lockstp:=false", "no parameter"),
        ("ros2 param set /team/controller rate 500.0", "read-only"),
        ("ros2 param set /team/controller lw natural", "no parameter"),
        ("ros2 service call /team/controller/halt std_srvs/srv/Trigger", "no service"),
        ("ros2 topic echo /team/cooperative/stat", "no topic"),
        ("ros2 topic pub /team/relative/authority std_msgs/msg/Bool '{data: true}'", "type"),
        ("ros2 topic pub /team/relative/authority std_msgs/msg/String '{dat: hold}'", "no field"),
        ("python examples/dor.py", "no file"),
        ("noninteractt check paper", "unknown command"),
    ],
)
def test_misspelt_command_is_found(command: str, reason: str) -> None:
    """A misspelt name fails the test of commands."""
    (words,) = commands.commands(command)
    with pytest.raises(Exception, match=reason):
        commands.check(words)


def test_gains_of_the_tuning_guide_are_made_by_its_command(tmp_path: Path) -> None:
    """The `sed` command of the guide makes a scenario that loads, with the gains that it names."""
    (block,) = [item for item in blocks("sh") if item.text.startswith("sed ")]
    (tmp_path / "config").symlink_to(ROOT / "config")
    command = block.text.partition("\nnoninteract")[0]
    subprocess.run(command, shell=True, cwd=tmp_path, check=True)
    scenario = Scenario.from_dict(read_parameters(tmp_path / "my.yaml"))
    gains = [spec.impedance for spec in scenario.subtasks.values()]
    stiffness = [gain.stiffness[0] for gain in gains]
    assert np.allclose(stiffness, [75.0, 170.0])
    assert np.allclose([gain.damping[0] for gain in gains], [30.0, 22.6])


def test_readme_is_short() -> None:
    """The README has at most 150 lines."""
    assert len((ROOT / "README.md").read_text().splitlines()) <= README_LINES


def test_every_block_is_in_the_reference() -> None:
    """Every dataclass that declares keys has its table on the page, with a text for every key."""
    declared = {
        item
        for name in structure.modules()
        if name and not name.startswith("nodes")
        for item in vars(import_module(f"{structure.PACKAGE}.{name}")).values()
        if isinstance(item, type) and is_dataclass(item)
        if any(scenario_reference.own_keys(item))
    }
    assert declared == set(scenario_reference.BLOCKS.values())
    marked = re.findall(r"^<!-- keys: (\w+) -->$", REFERENCE.read_text(), re.MULTILINE)
    assert sorted(marked) == sorted(scenario_reference.BLOCKS)
    for name, block in scenario_reference.BLOCKS.items():
        rows = scenario_reference.table(name).splitlines()[2:]
        assert len(rows) == len(list(scenario_reference.own_keys(block)))


@dataclass(frozen=True)
class Silent:
    """A block with a key that has no text."""

    value: float = key("")


def test_key_without_a_text_is_rejected(monkeypatch: pytest.MonkeyPatch) -> None:
    """The reference cannot be made while a key has no text."""
    monkeypatch.setitem(scenario_reference.BLOCKS, "silent", Silent)
    with pytest.raises(ValueError, match=r"silent\.value has no text"):
        scenario_reference.table("silent")


def test_table_of_programs_is_complete() -> None:
    """The interface lists the programs that setup.py installs."""
    rows = next(rows for heading, rows in tables(commands.INTERFACES) if heading == "Programs")
    assert [codes(row[0])[0] for row in rows] == list(programs())


def test_labels_of_energies_are_those_of_the_code() -> None:
    """The interface lists the labels of both energy topics in their order."""
    found = [rows for heading, rows in tables(commands.INTERFACES) if "State of" in heading]
    subtask, team = ([name for row in rows for name in codes(row[0])] for rows in found[1:])
    assert tuple(subtask) == LABELS
    assert tuple(team) == ("time", *QUANTITIES)
    text = commands.INTERFACES.read_text()
    for names in (LAWS, AUTHORITIES):
        assert ", ".join(f"{i} `{name}`" for i, name in enumerate(names)) in text


def test_parameters_of_the_recorder_are_those_of_the_code() -> None:
    """The interface lists the recorder's parameters."""
    rows = next(rows for heading, rows in tables(commands.INTERFACES) if heading == "Parameters")
    assert [codes(row[0])[0] for row in rows] == list(RECORDER_PARAMETERS)


def test_walk_through_a_tick_names_what_exists() -> None:
    """Every call of the walk is a method of a class of the module that it names."""
    rows = next(rows for heading, rows in tables(ARCHITECTURE) if heading == "One tick")
    for row in rows:
        owner, method = codes(row[1])[0].split(".")
        tree = ast.parse((ROOT / structure.PACKAGE / codes(row[2])[0]).read_text())
        (found,) = [
            item for item in tree.body if isinstance(item, ast.ClassDef) and item.name == owner
        ]
        methods = [item.name for item in found.body if isinstance(item, ast.FunctionDef)]
        assert method in methods, f"{owner} has no {method}"


def test_diagrams_are_drawn_by_their_script() -> None:
    """The SVG files are what docs/images/diagrams.py draws."""
    file = ROOT / "docs/images/diagrams.py"
    scope: dict[str, Any] = {"__file__": str(file), "__name__": "diagrams"}
    exec(compile(file.read_text(), file, "exec"), scope)
    for name, draw in scope["DRAWINGS"].items():
        assert (file.parent / name).read_text() == draw(), f"run: python {file.relative_to(ROOT)}"
