# SPDX-License-Identifier: Apache-2.0
"""The package's structure: who may import what, and facts that stand in more than one file."""

import ast
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterator

import pytest
import structure
from repository import ROOT, distribution, programs

import noninteract_ros
from noninteract_ros.nodes import PROGRAMS

ROS_MODULES = ("rclpy", "builtin_interfaces", "rcl_interfaces", "std_srvs", "ament_index_python")

# Floors from the ground up: a folder imports from its own floor's own folder and from below.
FLOORS: tuple[tuple[str, ...], ...] = (
    ("arrays", "clock", "compiler", "errors", "memo", ""),
    ("schema",),
    ("team",),
    ("subtasks",),
    ("control",),
    ("sources", "simulation"),
    ("scenario",),
    ("console",),
    ("reporting",),
    ("validation",),
    ("nodes",),
    ("cli",),
)
FLOOR = {part: number for number, parts in enumerate(FLOORS) for part in parts}
FILES = structure.modules()
GRAPH = structure.import_graph(FILES)
CROWDED = 16  # files in a folder, its __init__.py included


def ros_modules(tree: ast.AST) -> Iterator[str]:
    """Names of ROS modules that are imported anywhere under `tree`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [node.module or ""]
        else:
            continue
        roots = [name.partition(".")[0] for name in names]
        yield from (root for root in roots if root in ROS_MODULES or root.endswith("_msgs"))


class WithoutFunctions(ast.NodeTransformer):
    """Leaves the part of a module that runs on import."""

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        """Takes the function out."""


def violations(module: str, source: str) -> list[str]:
    """The imports that a module (dotted, below the package) must not make."""
    tree = ast.parse(source)
    part = module.partition(".")[0]
    if part == "cli":
        tree = WithoutFunctions().visit(tree)
    found = [f"{module} imports {name}" for name in ros_modules(tree) if part != "nodes"]
    for name in structure.imported(tree, FILES):
        other = name.partition(".")[0]
        lazy_program = part == "cli" and other == "nodes"
        if lazy_program or (FLOOR[other] >= FLOOR[part] and other != part):
            found.append(f"{module} imports {name}")
    return found


def test_only_nodes_import_ros_and_nothing_imports_upwards() -> None:
    """Each module imports only what stands below it, and ROS only in nodes (cli: when called)."""
    found = [line for name, file in FILES.items() for line in violations(name, file.read_text())]
    assert found == []


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("control.law.natural", "import rclpy"),
        ("team.team", "from geometry_msgs.msg import Pose"),
        ("schema", "def read():\n    from rclpy.node import Node"),
        ("team.team", "from noninteract_ros.subtasks import stack"),
        ("subtasks.stack", "from noninteract_ros.control import controller"),
        ("simulation.plant", "from noninteract_ros.nodes.messages.messages import to_array"),
        ("simulation.plant", "from noninteract_ros.sources import port"),
        ("nodes.controller.controller", "import noninteract_ros.cli"),
        ("cli", "import rclpy"),
        ("cli", "from noninteract_ros.nodes.recording.recorder import main"),
    ],
)
def test_a_forbidden_import_is_found(module: str, source: str) -> None:
    """The check above reports each kind of forbidden import."""
    assert len(violations(module, source)) == 1


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("control.law.natural", "from noninteract_ros.subtasks.stack import SubtaskStack"),
        (
            "nodes.controller.controller",
            "import rclpy\nfrom noninteract_ros.control import controller",
        ),
        ("cli", "def demo():\n    import rclpy"),
    ],
)
def test_an_allowed_import_is_not_reported(module: str, source: str) -> None:
    """The check above leaves downward and lazy imports alone."""
    assert violations(module, source) == []


def test_no_imports_in_a_circle() -> None:
    """Neither files nor folders import each other in a circle."""
    assert structure.cycles(GRAPH) == []
    assert structure.cycles(structure.folder_graph(GRAPH, FILES)) == []


def test_a_circle_is_found() -> None:
    """The check above finds a circle over three nodes, and only the nodes on it."""
    assert structure.cycles({"a": {"b"}, "b": {"c"}, "c": {"a", "d"}, "d": set()}) == [
        ["a", "b", "c"]
    ]


def test_no_program_imports_what_only_validates() -> None:
    """No program of a run loads the checks of `validation`."""
    for program in PROGRAMS.values():
        reached = structure.closure(GRAPH, f"nodes.{program}")
        assert {name for name in reached if name.startswith("validation")} == set()


def test_each_folder_is_small_and_says_what_it_is_for() -> None:
    """Every folder has at most fifteen modules and a sentence at its top."""
    counts = Counter(structure.folder_of(name, FILES) for name in FILES)
    assert {name: count for name, count in counts.items() if count > CROWDED} == {}
    folders = [file for file in FILES.values() if file.name == "__init__.py"]
    assert [file for file in folders if not ast.get_docstring(ast.parse(file.read_text()))] == []


def test_version_is_the_same_everywhere() -> None:
    """package.xml, setup.py and the module name one version."""
    manifest = ElementTree.parse(ROOT / "package.xml").findtext("version")
    assert manifest == distribution().get_version() == noninteract_ros.__version__


def test_each_program_can_be_started_by_its_name() -> None:
    """`python -m noninteract_ros.nodes` knows the programs of setup.py's entry points."""
    known = {name: f"noninteract_ros.nodes.{path}:main" for name, path in PROGRAMS.items()}
    assert known == {name: main for name, main in programs().items() if name != "noninteract"}


def test_each_program_has_its_script() -> None:
    """scripts/ holds one executable link per entry point of setup.py, and nothing else."""
    links = {file.name: file for file in (ROOT / "scripts").iterdir() if file.is_symlink()}
    assert set(links) == set(programs())
    for link in links.values():
        assert link.resolve() == ROOT / "scripts" / "program"
        assert link.stat().st_mode & 0o777 == 0o755
