# SPDX-License-Identifier: Apache-2.0
"""Validation of messages from pages."""

import json
from typing import Any

import numpy as np
import pytest

from noninteract_ros.console.held_input import PageDrag, PageTwist
from noninteract_ros.console.protocol import KINDS, held_input, parse
from noninteract_ros.errors import InputError

IDENTITY_ROTATION = [0.0, 0.0, 0.0, 1.0]
GOOD: dict[str, dict[str, Any]] = {
    "hello": {"version": 2, "token": "abc"},
    "drag": {
        "subtask": "a",
        "element": 0,
        "grab": 1,
        "translation": [0.1, 0, -2],
        "rotation": IDENTITY_ROTATION,
    },
    "twist": {
        "subtask": "a",
        "element": 0,
        "grab": 1,
        "linear": [1, -1, 0.5],
        "angular": [0, 0, 0],
    },
    "authority": {"subtask": "a", "source": "hold"},
    "law": {"law": "natural"},
    "gains": {"subtask": "a", "name": "damping", "values": [1.0, 2.5]},
    "pause": {"on": True},
}
BAD: list[tuple[str, dict[str, Any]]] = [
    ("hello", {"version": "1"}),
    ("hello", {"token": "x" * 200}),
    ("drag", {"subtask": 3}),
    ("drag", {"element": -1}),
    ("drag", {"element": True}),
    ("drag", {"grab": 1.5}),
    ("drag", {"translation": [0.0, 0.0]}),
    ("drag", {"translation": [0.0, 0.0, "0"]}),
    ("drag", {"translation": [0.0, 0.0, True]}),
    ("drag", {"translation": [0.0, 0.0, 1e9]}),
    ("drag", {"rotation": [0.0, 0.0, 0.0, 0.0]}),
    ("drag", {"rotation": [0.0, 0.0, 1.0, 1.0]}),
    ("twist", {"linear": [1.5, 0.0, 0.0]}),
    ("twist", {"angular": None}),
    ("authority", {"source": "nobody"}),
    ("authority", {"source": ["human"]}),
    ("gains", {"name": "inertia"}),
    ("gains", {"values": []}),
    ("gains", {"values": [1.0] * 1000}),
    ("gains", {"values": 1.0}),
    ("pause", {"on": 1}),
    ("law", {"law": "\ud800"}),
    ("law", {"law": "paper\0"}),
    ("hello", {"token": "\udfff"}),
    ("gains", {"values": [10**1000]}),
    ("twist", {"linear": [0.0, 0.0, 10**1000]}),
    ("drag", {"rotation": [0, 0, 0, 10**1000]}),
    ("drag", {"element": 10**1000}),
]


def text(kind: str, **changes: Any) -> str:
    return json.dumps({"kind": kind} | GOOD.get(kind, {}) | changes)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_parsed(kind: str) -> None:
    """Kind and values of a valid message are returned unchanged."""
    command = parse(text(kind))
    assert command.kind == kind
    assert dict(command.values) == GOOD.get(kind, {})


@pytest.mark.parametrize(("kind", "changes"), BAD)
def test_an_invalid_value_is_rejected(kind: str, changes: dict[str, Any]) -> None:
    """One invalid value rejects the whole message."""
    with pytest.raises(InputError, match=f"{kind}: invalid"):
        parse(text(kind, **changes))


@pytest.mark.parametrize("kind", KINDS)
def test_missing_and_unknown_keys_are_rejected(kind: str) -> None:
    """The keys have to be exactly those of the kind."""
    with pytest.raises(InputError, match="missing or unknown keys"):
        parse(text(kind, more=1))
    for name in GOOD.get(kind, {}):
        content = json.loads(text(kind))
        del content[name]
        with pytest.raises(InputError, match="missing or unknown keys"):
            parse(json.dumps(content))


@pytest.mark.parametrize(
    "data",
    [
        b"{}",
        "",
        "heartbeat",
        "[]",
        "null",
        '{"kind": "heartbeat"',
        '{"kind": "fly"}',
        '{"kind": ["heartbeat"]}',
        "[" * 4000,
        text("twist").replace("0.5", "NaN"),
        text("twist").replace("0.5", "Infinity"),
        text("twist").replace("0.5", "1e999"),
    ],
)
def test_other_data_is_rejected(data: str | bytes) -> None:
    """Invalid JSON, other JSON types, unknown kinds and non-finite numbers are rejected."""
    with pytest.raises(InputError):
        parse(data)


def test_held_inputs_are_converted_to_arrays() -> None:
    """Drags and twists are held inputs; other messages are not."""
    drag, twist = held_input(parse(text("drag"))), held_input(parse(text("twist")))
    assert isinstance(drag, PageDrag)
    assert isinstance(twist, PageTwist)
    np.testing.assert_array_equal(drag.translation, [0.1, 0.0, -2.0])
    np.testing.assert_array_equal(twist.linear, [1.0, -1.0, 0.5])
    assert held_input(parse(text("release"))) is None
