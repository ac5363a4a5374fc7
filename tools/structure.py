# SPDX-License-Identifier: Apache-2.0
"""Print the package's structure: `python tools/structure.py`.

Lists files and lines per folder, cycles of imports between files and between folders, modules
with one importer, and the import closure of modules. Only imports are read; nothing is run.
"""

import argparse
import ast
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

PACKAGE = "noninteract_ros"
ROOT = Path(__file__).resolve().parent.parent
CLOSURES = ("control.controller", "nodes.controller.controller")

Graph = Mapping[str, set[str]]


def modules(root: Path = ROOT) -> dict[str, Path]:
    """Return the file of each module, by its dotted name below the package; folders by theirs."""
    found = {}
    for file in sorted((root / PACKAGE).rglob("*.py")):
        parts = file.relative_to(root / PACKAGE).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return found


def imported(tree: ast.AST, names: Iterable[str]) -> Iterator[str]:
    """Yield the modules among `names` that a syntax tree imports, in functions too."""
    for node in ast.walk(tree):
        found: list[tuple[str, ...]] = []  # the first of each that is a module counts
        if isinstance(node, ast.Import):
            found = [(alias.name,) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            found = [(f"{node.module}.{alias.name}", node.module) for alias in node.names]
        for candidates in found:
            inner = (name.removeprefix(f"{PACKAGE}.") for name in candidates)
            yield from [name for name in inner if name in names][:1]


def import_graph(files: Mapping[str, Path]) -> dict[str, set[str]]:
    """Return which modules each module imports; a folder counts where it defines something."""
    return {
        name: set(imported(ast.parse(file.read_text()), files)) - {name}
        for name, file in files.items()
    }


def folder_of(module: str, files: Mapping[str, Path]) -> str:
    """Return the folder that holds a module; a module beside the folders counts as its own."""
    if files[module].name == "__init__.py" or "." not in module:
        return module
    return module.rpartition(".")[0]


def folder_graph(graph: Graph, files: Mapping[str, Path]) -> dict[str, set[str]]:
    """Return which folders each folder imports from."""
    result: dict[str, set[str]] = {}
    for module, targets in graph.items():
        home = folder_of(module, files)
        result.setdefault(home, set()).update(folder_of(other, files) for other in targets)
    return {home: targets - {home} for home, targets in result.items()}


def closure(graph: Graph, start: str) -> set[str]:
    """Return all modules that importing `start` brings, itself included."""
    reached, waiting = set(), [start]
    while waiting:
        name = waiting.pop()
        if name not in reached:
            reached.add(name)
            waiting.extend(graph.get(name, ()))
    return reached


def cycles(graph: Graph) -> list[list[str]]:
    """Return the groups of nodes that reach each other, each sorted."""
    reach = {name: closure(graph, name) for name in graph}
    groups = {
        tuple(sorted(other for other in reach[name] if name in reach.get(other, ())))
        for name in graph
    }
    return sorted(list(group) for group in groups if len(group) > 1)


def single_importers(graph: Graph) -> dict[str, str]:
    """Return the modules that exactly one other imports, with that one."""
    users: dict[str, list[str]] = {}
    for name, targets in graph.items():
        for target in targets:
            users.setdefault(target, []).append(name)
    return {name: found[0] for name, found in sorted(users.items()) if len(found) == 1}


def _lines(file: Path) -> int:
    return len(file.read_text().splitlines())


def _classes(file: Path) -> int:
    return sum(isinstance(node, ast.ClassDef) for node in ast.walk(ast.parse(file.read_text())))


def main() -> None:
    """Print the structure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("closures", nargs="*", default=CLOSURES, help="modules to follow")
    chosen = parser.parse_args().closures
    files = modules()
    graph = import_graph(files)
    counts = Counter(folder_of(name, files) for name in files)
    sizes: Counter[str] = Counter()
    for name, file in files.items():
        sizes[folder_of(name, files)] += _lines(file)
    print("files  lines  folder")
    for folder in sorted(counts):
        print(f"{counts[folder]:5}  {sizes[folder]:5}  {folder or PACKAGE}")
    print(f"{len(files):5}  {sum(sizes.values()):5}  in all")
    for title, found in (
        ("cycles of files", cycles(graph)),
        ("cycles of folders", cycles(folder_graph(graph, files))),
    ):
        print(f"\n{title}: {len(found)}")
        for group in found:
            print("  " + ", ".join(name or PACKAGE for name in group))
    single = single_importers(graph)
    print(f"\nmodules with one importer: {len(single)}")
    for name, user in single.items():
        print(f"  {name} <- {user}")
    for start in chosen:
        reached = [files[name] for name in closure(graph, start) if _lines(files[name]) > 1]
        lines, classes = sum(map(_lines, reached)), sum(map(_classes, reached))
        print(
            f"\nimport closure of {start}: {len(reached)} files, {lines} lines, {classes} classes"
        )


if __name__ == "__main__":
    main()
