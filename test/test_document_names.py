# SPDX-License-Identifier: Apache-2.0
"""Names of tests and source files in the documents."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from repository import ROOT

DOCUMENTS = sorted((*ROOT.glob("docs/**/*.md"), *ROOT.glob("*.md")))
TEST = re.compile(r"\btest_\w+\b(?!\.)")
SOURCE = re.compile(r"`((?:\w+/)+\w+\.py)`")


def known_tests() -> set[str]:
    """Return the names of all tests and test modules."""
    names: set[str] = set()
    for file in ROOT.glob("test/**/*.py"):
        names |= {file.stem, *re.findall(r"def (test_\w+)", file.read_text())}
    return names


def missing(text: str) -> Iterator[str]:
    """Yield the names of tests and source files in a text that do not exist."""
    yield from set(TEST.findall(text)) - known_tests()
    for path in SOURCE.findall(text):
        if not any((folder / path).is_file() for folder in (ROOT, ROOT / "noninteract_ros")):
            yield path


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda file: file.name)
def test_documents_name_existing_tests_and_files(document: Path) -> None:
    """Every test and source file named in a document exists."""
    assert sorted(missing(document.read_text())) == []


def test_a_missing_name_is_found() -> None:
    """The check above reports a renamed test and a moved file."""
    text = "`test_of_nothing`, `control/no_such_file.py`, `control/controller.py`"
    assert sorted(missing(text)) == ["control/no_such_file.py", "test_of_nothing"]
