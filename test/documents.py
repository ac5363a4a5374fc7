# SPDX-License-Identifier: Apache-2.0
"""The documents of the repository: their fenced blocks and their tables."""

import re
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from repository import ROOT

FENCE = re.compile(r"^( *)```(\w+)\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
CODE = re.compile(r"`([^`]+)`")


@dataclass(frozen=True)
class Block:
    """A fenced block of a document.

    Attributes:
        file: The document.
        line: Line of its first fence.
        language: Name after the fence.
        text: Content without its indentation.
    """

    file: Path
    line: int
    language: str
    text: str

    def __str__(self) -> str:
        return f"{self.file.relative_to(ROOT)}:{self.line}"


def documents() -> list[Path]:
    """Return all documents, README.md first."""
    docs = sorted((ROOT / "docs").rglob("*.md"))
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "benchmarks/README.md", *docs]


def blocks(language: str) -> list[Block]:
    """Return the fenced blocks of a language in all documents."""
    return [
        Block(file, text.count("\n", 0, found.start()) + 1, language, textwrap.dedent(found[3]))
        for file in documents()
        for text in [file.read_text()]
        for found in FENCE.finditer(text)
        if found[2] == language
    ]


def tables(file: Path) -> Iterator[tuple[str, list[list[str]]]]:
    """Yield the tables of a document: the heading above each, and the cells of its rows."""
    heading, rows = "", []
    for line in [*file.read_text().splitlines(), ""]:
        if line.startswith("#"):
            heading = line.lstrip("# ")
        if line.startswith("|"):
            rows.append([cell.strip() for cell in line.strip("|").split("|")])
        elif rows:
            yield heading, rows[2:]
            rows = []


def codes(cell: str) -> list[str]:
    """Return the code spans of a cell."""
    return CODE.findall(cell)
