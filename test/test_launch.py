# SPDX-License-Identifier: Apache-2.0
"""Launch file, with a mock of `launch`, which PyPI does not provide."""

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
    """Mock of any launch or launch_ros object; it stores its arguments."""

    arguments: tuple[Any, ...]
    options: dict[str, Any] = field(default_factory=dict)

    def perform(self, context: SimpleNamespace) -> str:
        """Return the value of a LaunchConfiguration."""
        return context.launch_configurations[self.arguments[0]]


def mock_module(module: str, *names: str) -> ModuleType:
    """Return a module whose classes store their arguments."""
    created = ModuleType(module)
    for name in names:
        kind = type(name, (Action,), {"__init__": _store_arguments})
        setattr(created, name, kind)
    return created


def _store_arguments(self: Action, *arguments: Any, **options: Any) -> None:
    Action.__init__(self, arguments, options)


@pytest.fixture
def launch_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> dict[str, Any]:
    """Return the names that the launch file defines, with the package under `tmp_path`."""
    for module in (
        mock_module("launch", "LaunchContext", "LaunchDescription"),
        mock_module("launch.actions", "DeclareLaunchArgument", "OpaqueFunction", "Shutdown"),
        mock_module("launch.conditions", "IfCondition"),
        mock_module("launch.substitutions", "LaunchConfiguration"),
        mock_module("launch_ros"),
        mock_module("launch_ros.actions", "Node"),
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
    """Return the nodes that `ros2 launch` would start with these launch arguments."""
    (actions,) = launch_file["generate_launch_description"]().arguments
    declared = [action for action in actions if type(action).__name__ == "DeclareLaunchArgument"]
    values = {action.arguments[0]: action.options["default_value"] for action in declared}
    assert set(arguments) <= set(values)
    context = SimpleNamespace(launch_configurations=values | arguments)
    (start,) = (action for action in actions if type(action).__name__ == "OpaqueFunction")
    return start.options["function"](context)


NOT_LAUNCHED = {
    "noninteract",
    "operator_console",
    "joy_operator",
    "pose_operator",
    "keyboard_operator",
}


def test_every_program_of_a_run_is_launched(launch_file: dict[str, Any]) -> None:
    """These are all programs of setup.py but the command line and the operator devices."""
    nodes = started_nodes(launch_file)
    assert {node.options["package"] for node in nodes} == {PACKAGE}
    started = [node.options["executable"] for node in nodes]
    assert sorted(started) == sorted(set(programs()) - NOT_LAUNCHED)


def test_all_nodes_share_one_scenario_and_namespace(launch_file: dict[str, Any]) -> None:
    """Every node has the parameter file of the scenario and the namespace argument."""
    for node in started_nodes(launch_file, scenario="paper"):
        assert node.options["parameters"] == [str(ROOT / "config" / "paper.yaml")]
        assert node.options["namespace"].arguments == ("namespace",)


def test_a_scenario_may_be_a_path(launch_file: dict[str, Any], tmp_path: Path) -> None:
    """The scenario argument accepts the path of a parameter file."""
    mine = tmp_path / "mine.yaml"
    mine.touch()
    nodes = started_nodes(launch_file, scenario=str(mine))
    assert {node.options["parameters"][0] for node in nodes} == {str(mine)}


def test_an_unknown_scenario_is_rejected(launch_file: dict[str, Any]) -> None:
    """The error names the argument and the installed scenarios."""
    with pytest.raises(FileNotFoundError, match=r"'papre', allowed: a path or .*\bpaper\b"):
        started_nodes(launch_file, scenario="papre")


def test_only_the_recorder_depends_on_record(launch_file: dict[str, Any]) -> None:
    """`record:=false` omits the recorder only."""
    for node in started_nodes(launch_file):
        condition = node.options.get("condition")
        if node.options["executable"] == "recorder":
            assert condition.arguments[0].arguments == ("record",)
        else:
            assert condition is None
