# SPDX-License-Identifier: Apache-2.0
"""Hooks of the documentation site: pages made from the repository, and tables made from the code.

MkDocs calls the functions `on_*`. Files of the repository such as README.md become pages, and
links to files outside docs/ lead to these pages. A comment `<!-- NAME: ARGUMENT -->` that stands
alone on a line is replaced by what the generator of that name makes.
"""

import ast
import posixpath
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

TOOLS = Path(__file__).resolve().parent
ROOT = TOOLS.parent
sys.path[:0] = [str(ROOT), str(TOOLS)]  # MkDocs loads this file by its path.

import command_reference  # noqa: E402
import scenario_reference  # noqa: E402

PACKAGE = "noninteract_ros"
MARKER = re.compile(r"^<!-- ([a-z]+)(?:: ([\w./]+))? -->$", re.MULTILINE)
LINK = re.compile(r"(?<=\]\()([^)\s#:]+)(#[^)\s]*)?(?=\))")
# Files of the repository that are pages of the site.
PAGES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "LICENSE": "license.md",
}
SOURCES = {page: source for source, page in PAGES.items()}
ALONE = ("index.md", "tutorial.md")  # pages without others beside them
INTERNAL = ("control.fast", "control.telemetry")  # folders without a public interface


def on_files(files: Any, config: Any) -> Any:
    """Add the files of the repository that are pages of the site."""
    from mkdocs.structure.files import File

    for source, page in PAGES.items():
        text = (ROOT / source).read_text()
        if not source.endswith(".md"):
            text = f"# Licence\n\n```text\n{text}```\n"
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Lead links outside docs/ to pages of the site, and expand the markers."""
    source = page.file.src_uri
    if source in ALONE:
        page.meta["hide"] = ["navigation"]
    path = SOURCES.get(source, f"docs/{source}")
    linked = LINK.sub(lambda link: site_link(path, source, link[1], link[2] or ""), markdown)
    return expanded(linked)


def site_link(path: str, source: str, target: str, anchor: str) -> str:
    """Return the address within the site of a link.

    Args:
        path: File that holds the link, from the root of the repository.
        source: The page that it is, from docs/.
        target: The link as it is written, without its anchor.
        anchor: Anchor with its `#`, or an empty text.
    """
    found = posixpath.normpath(posixpath.join(posixpath.dirname(path), target))
    stem = posixpath.splitext(posixpath.basename(found))[0]
    if found in PAGES:
        place = PAGES[found]
    elif found.startswith("docs/"):
        place = found.removeprefix("docs/")
    elif found.startswith("config"):
        place, anchor = "reference/scenarios.md", f"#{stem}" if found.endswith(".yaml") else ""
    elif found.startswith("examples"):
        place, anchor = "reference/examples.md", f"#{stem}" if found.endswith(".py") else ""
    else:
        return target + anchor  # A strict build refuses it.
    return posixpath.relpath(place, posixpath.dirname(source) or ".") + anchor


def expanded(markdown: str) -> str:
    """Return a page with its markers replaced by generated text.

    Raises:
        KeyError: There is no generator of a marker's name.
    """
    return MARKER.sub(lambda found: GENERATORS[found[1]](found[2] or ""), markdown)


def scenarios(folder: str) -> str:
    """Return the scenario files of a folder, each with the comment at its top as its text."""
    parts = []
    for file in sorted((ROOT / folder).glob("*.yaml")):
        lines = file.read_text().splitlines()
        count = next(i for i, line in enumerate(lines) if not line.startswith("#"))
        comment = "\n".join(line.removeprefix("#").strip() for line in lines[:count])
        content = "\n".join(lines[count:])
        yaml.safe_load(content)
        parts.append(f"## {file.stem}\n\n{comment}\n\n```yaml\n{content}\n```")
    return "\n\n".join(parts)


def examples(folder: str) -> str:
    """Return the examples of a folder, each with its docstring as its text."""
    parts = []
    for file in sorted((ROOT / folder).glob("*.py")):
        source = file.read_text()
        tree = ast.parse(source)
        text = ast.get_docstring(tree) or ""
        start = tree.body[0].end_lineno or 0
        code = "\n".join(source.splitlines()[start:]).strip()
        run = f"```sh\npython {folder}/{file.name}\n```"
        parts.append(f"## {file.stem}\n\n{text}\n\n{run}\n\n```python\n{code}\n```")
    return "\n\n".join(parts)


def modules(package: str) -> str:
    """Return the API reference of all modules of a folder, those of its subfolders included."""
    folder = ROOT / PACKAGE / package
    parts = []
    for file in sorted(folder.rglob("*.py")):
        name = ".".join(file.relative_to(ROOT / PACKAGE).with_suffix("").parts)
        if file.stem.startswith("_") or name.startswith(INTERNAL):
            continue
        parts.append(f"## {name}\n\n::: {PACKAGE}.{name}")
    return "\n\n".join(parts)


GENERATORS: dict[str, Callable[[str], str]] = {
    "keys": scenario_reference.table,
    "commands": lambda _: command_reference.commands(),
    "scenarios": scenarios,
    "examples": examples,
    "modules": modules,
}
