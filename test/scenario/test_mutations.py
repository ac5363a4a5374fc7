# SPDX-License-Identifier: Apache-2.0
"""Mutations of scenario files: each loads, or is refused in one line with file and key."""

import copy
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from noninteract_ros.errors import ScenarioError
from noninteract_ros.nodes.common.parameter_files import rewrite
from noninteract_ros.scenario.files import load_scenario

CONFIG = Path(__file__).resolve().parents[2] / "config"
TEXTS = [re.sub(" *#.*", "", (CONFIG / f"{name}.yaml").read_text()) for name in ("paper", "wall")]
LONGEST = 2000  # Characters of an error.
ODD = st.sampled_from(
    [
        None, True, 0, -1, 1, 10**400, 2**63, 1e300, -1e9, 1e-300, 5e-324, float("nan"),
        float("inf"), "", " ", "no", "1e3", "\n", "ä", "x" * 300, "robot_1", "world", "human", [],
        [[]], [0], [0.0, 0.0], [1.0] * 3, [1e9] * 6, [1, "a"], [None], ["x", "x"], ["x"] * 999, {},
        {"a": {"b": {"c": 1}}}, {"mass": 1.0}, {"": 1},
    ]
)  # fmt: skip
SNIPPETS = st.sampled_from(
    [
        "", " ", "\n", "\t", ":", ": ", "- ", "[", "]", "{", "}", "'", '"', "#", " # ", "&a ",
        "*a",
        "!!set ", "!x ", "| ", "> ", "? ", "%", "@", "`", "<<: ", "---\n", "...\n", "\r", "\x00",
        "\ufeff", "\u2028", "é", "0x", "1e", "1e999", "9" * 5000, "[" * 2000, "{a: " * 99,
        "ros__parameters: ", "\n    robots: [a, b]\n", "a.b.c: 1", '"\\ud800"',
        "~", ".nan", "-.inf",
    ]
)  # fmt: skip


def paths(values: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the paths of all values below a content."""
    items = values.items() if isinstance(values, dict) else enumerate(values)
    for key, value in items:
        yield (*path, key)
        if isinstance(value, (dict, list)):
            yield from paths(value, (*path, key))


DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)  # The same, in C.
CONTENTS = [yaml.safe_load(text) for text in TEXTS]
PATHS = [list(paths(content)) for content in CONTENTS]


@st.composite
def changed_values(draw: Any) -> bytes:
    """Return a scenario with up to three values replaced, removed, renamed or moved."""
    which = draw(st.integers(0, len(CONTENTS) - 1))
    content = copy.deepcopy(CONTENTS[which])
    for _ in range(draw(st.integers(1, 3))):
        *owners, key = draw(st.sampled_from(PATHS[which]))
        block = content
        try:
            for owner in owners:
                block = block[owner]
            change = draw(st.sampled_from(["replace", "remove", "rename", "move", "add"]))
            if change == "replace":
                block[key] = draw(ODD)
            elif change == "remove":
                del block[key]
            elif change == "add":
                block[str(draw(ODD))] = draw(ODD)
            elif change == "rename":
                block[draw(st.sampled_from(["no", 1, "", "a.b", "x" * 300]))] = block.pop(key)
            else:
                block[key] = copy.deepcopy(content)
        except (LookupError, TypeError, AttributeError):
            continue  # An earlier change removed the place of this one.
    return yaml.dump(content, Dumper=DUMPER, allow_unicode=True).encode()


@st.composite
def changed_text(draw: Any) -> bytes:
    """Return the text of a scenario with up to three slices replaced by odd snippets."""
    text = draw(st.sampled_from(TEXTS))
    for _ in range(draw(st.integers(1, 3))):
        start = draw(st.integers(0, len(text)))
        end = start + draw(st.sampled_from([0, 0, 1, 2, 5, 50]))
        text = text[:start] + draw(SNIPPETS) + text[end:]
    data = text.encode()
    return draw(st.sampled_from([data, data, data, data[: len(data) // 2], data + b"\xff"]))


def check(data: bytes, file: Path) -> None:
    """Check that a file loads, or is refused in one short line that begins with its name."""
    file.write_bytes(data)
    try:
        load_scenario(file)
        rewrite(["", "--params-file", str(file)], file.parent)
    except ScenarioError as error:
        text = str(error)
        begins, named = text.startswith(f"{file}: "), ": found " in text
        assert (begins, named, "\n" in text) == (True, True, False), text
        assert len(text) < LONGEST


QUICK = settings(
    max_examples=1000,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=list(HealthCheck),
)


@QUICK
@given(data=changed_values())
def test_changed_values(tmp_path_factory: Any, data: bytes) -> None:
    """Values of other types and sizes, and keys that are missing, moved or renamed."""
    check(data, tmp_path_factory.getbasetemp() / "values.yaml")


@QUICK
@given(data=changed_text())
def test_changed_text(tmp_path_factory: Any, data: bytes) -> None:
    """Texts that are hardly YAML any more."""
    check(data, tmp_path_factory.getbasetemp() / "text.yaml")
