# SPDX-License-Identifier: Apache-2.0
"""The launch file, run against a stand-in for `launch`, which PyPI does not have."""

import runpy
import sys
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
from repository import PACKAGE, ROOT, programs


@dataclass
class Action:
    """Any object of launch or launch_ros: it keeps what it was made with."""

    arguments: tuple[Any, ...]
    options: dict[str, Any] = field(default_factory=dict)

    def perform(self, context: SimpleNamespace) -> str:
        """The value of a LaunchConfiguration."""
        return context.launch_configurations[self.arguments[0]]


def stand_in(module: str, *names: str) -> ModuleType:
    """A module whose classes record their arguments."""
    made = ModuleType(module)
    for name in names:
        kind = type(name, (Action,), {"__init__": _keep})
        setattr(made, name, kind)
    return made


def _keep(self: Action, *arguments: Any, **options: Any) -> None:
    Action.__init__(self, arguments, options)


@pytest.fixture
def launch_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> dict[str, Any]:
    """The names that the launch file defines, with the package installed under `tmp_path`."""
    for module in (
        stand_in("launch", "LaunchContext", "LaunchDescription"),
        stand_in("launch.actions", "DeclareLaunchArgument", "OpaqueFunction", "Shutdown"),
        stand_in("launch.conditions", "IfCondition"),
        stand_in("launch.substitutions", "LaunchConfiguration"),
        stand_in("launch_ros"),
        stand_in("launch_ros.actions", "Node"),
    ):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    index = tmp_path / "share" / "ament_index" / "resource_index" / "packages"
    index.mkdir(parents=True)
    (index / PACKAGE).touch()
    (tmp_path / "share" / PACKAGE).mkdir()
    (tmp_path / "share" / PACKAGE / "config").symlink_to(ROOT / "config")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    return runpy.run_path(str(ROOT / "launch" / "team.launch.py"))


def started_nodes(launch_file: dict[str, Any], **arguments: str) -> list[Action]:
    """The nodes that `ros2 launch` would start with these launch arguments."""
    (actions,) = launch_file["generate_launch_description"]().arguments
    declared = [action for action in actions if type(action).__name__ == "DeclareLaunchArgument"]
    values = {action.arguments[0]: action.options["default_value"] for action in declared}
    assert set(arguments) <= set(values)
    context = SimpleNamespace(launch_configurations=values | arguments)
    (start,) = (action for action in actions if type(action).__name__ == "OpaqueFunction")
    return start.options["function"](context)


OPERATED = {
    "noninteract",
    "operator_console",
    "joy_operator",
    "pose_operator",
    "keyboard_operator",
}


def test_every_program_of_a_run_is_started(launch_file: dict[str, Any]) -> None:
    """Programs of setup.py, apart from the command line and those of a person's devices."""
    nodes = started_nodes(launch_file)
    assert {node.options["package"] for node in nodes} == {PACKAGE}
    started = [node.options["executable"] for node in nodes]
    assert sorted(started) == sorted(set(programs()) - OPERATED)


def test_all_nodes_share_one_scenario_and_namespace(launch_file: dict[str, Any]) -> None:
    """Every node gets the parameter file of the named scenario and the given namespace."""
    for node in started_nodes(launch_file, scenario="paper"):
        assert node.options["parameters"] == [str(ROOT / "config" / "paper.yaml")]
        assert node.options["namespace"].arguments == ("namespace",)


def test_a_scenario_may_be_a_path(launch_file: dict[str, Any], tmp_path: Path) -> None:
    """A parameter file anywhere can be launched."""
    mine = tmp_path / "mine.yaml"
    mine.touch()
    nodes = started_nodes(launch_file, scenario=str(mine))
    assert {node.options["parameters"][0] for node in nodes} == {str(mine)}


def test_an_unknown_scenario_is_refused(launch_file: dict[str, Any]) -> None:
    """The error names what was found and the installed scenarios."""
    with pytest.raises(FileNotFoundError, match=r"'papre', allowed: a path or .*\bpaper\b"):
        started_nodes(launch_file, scenario="papre")


def test_only_the_recorder_depends_on_record(launch_file: dict[str, Any]) -> None:
    """`record:=false` leaves out the recorder and nothing else."""
    for node in started_nodes(launch_file):
        condition = node.options.get("condition")
        if node.options["executable"] == "recorder":
            assert condition.arguments[0].arguments == ("record",)
        else:
            assert condition is None
