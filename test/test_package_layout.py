# SPDX-License-Identifier: Apache-2.0
"""The package's structure: who may import what, and facts that stand in more than one file."""

import ast
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator

import pytest
from repository import PACKAGE, ROOT, distribution, programs

import noninteract_ros

ROS_MODULES = ("rclpy", "builtin_interfaces", "rcl_interfaces", "std_srvs", "ament_index_python")

# What each part must not import: whatever stands above it. "" are the modules beside the parts.
ABOVE = {
    "team": {
        "subtasks",
        "control",
        "simulation",
        "operator",
        "console",
        "analysis",
        "nodes",
        "cli",
    },
    "subtasks": {"control", "simulation", "operator", "console", "analysis", "nodes", "cli"},
    "control": {"simulation", "operator", "console", "analysis", "nodes", "cli"},
    "simulation": {"console", "analysis", "nodes", "cli"},
    "operator": {"console", "analysis", "nodes", "cli"},
    "console": {"nodes", "cli"},
    "analysis": {"console", "nodes", "cli"},
    "nodes": {"cli"},
    "": {"analysis", "nodes", "cli"},
}


def imported_modules(tree: ast.AST, package: list[str]) -> Iterator[str]:
    """Dotted names of all that is imported anywhere under `tree`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            yield from (f"{module}.{alias.name}" for alias in node.names)


class WithoutFunctions(ast.NodeTransformer):
    """Leaves the part of a module that runs on import."""

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        """Takes the function out."""


def violations(path: str, source: str) -> list[str]:
    """The imports that the module at `path` (relative to the package) must not make."""
    package = path.split("/")[:-1]
    tree = ast.parse(source)
    if path == "cli.py":
        part, forbidden = "cli", {"nodes"}
        tree = WithoutFunctions().visit(tree)
    else:
        part = package[0] if package else ""
        forbidden = ABOVE[part]
    found = []
    for name in imported_modules(tree, [PACKAGE, *package]):
        root, *rest = name.split(".")
        ros = root in ROS_MODULES or root.endswith("_msgs")
        upwards = root == PACKAGE and rest and rest[0] in forbidden
        if (ros and part != "nodes") or upwards:
            found.append(f"{path} imports {name}")
    return found


def test_only_nodes_import_ros_and_nothing_imports_upwards() -> None:
    """Each module imports only what stands below it, and ROS only in nodes (cli: when called)."""
    sources = ROOT / PACKAGE
    found = [
        line
        for file in sorted(sources.rglob("*.py"))
        for line in violations(file.relative_to(sources).as_posix(), file.read_text())
    ]
    assert found == []


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("control/law.py", "import rclpy"),
        ("team/team.py", "from geometry_msgs.msg import Pose"),
        ("schema.py", "def read():\n    from rclpy.node import Node"),
        ("team/team.py", "from noninteract_ros.subtasks import stack"),
        ("team/team.py", "from ..subtasks import stack"),
        ("subtasks/stack.py", "from noninteract_ros import control"),
        ("simulation/object.py", "from noninteract_ros.nodes.messages import to_array"),
        ("nodes/controller.py", "import noninteract_ros.cli"),
        ("cli.py", "import rclpy"),
        ("cli.py", "from noninteract_ros.nodes.recorder import main"),
    ],
)
def test_a_forbidden_import_is_found(path: str, source: str) -> None:
    """The check above reports each kind of forbidden import."""
    assert len(violations(path, source)) == 1


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("control/law.py", "from noninteract_ros.subtasks.stack import Stack"),
        ("nodes/controller.py", "import rclpy\nfrom noninteract_ros.control import law"),
        ("cli.py", "def demo():\n    import rclpy"),
    ],
)
def test_an_allowed_import_is_not_reported(path: str, source: str) -> None:
    """The check above leaves downward and lazy imports alone."""
    assert violations(path, source) == []


def test_version_is_the_same_everywhere() -> None:
    """package.xml, setup.py and the module name one version."""
    manifest = ElementTree.parse(ROOT / "package.xml").findtext("version")
    assert manifest == distribution().get_version() == noninteract_ros.__version__


def test_each_program_has_its_script() -> None:
    """scripts/ holds one executable link per entry point of setup.py, and nothing else."""
    links = {file.name: file for file in (ROOT / "scripts").iterdir() if file.is_symlink()}
    assert set(links) == set(programs())
    for link in links.values():
        assert link.resolve() == ROOT / "scripts" / "program"
        assert link.stat().st_mode & 0o777 == 0o755
