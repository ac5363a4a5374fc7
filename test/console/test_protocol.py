# SPDX-License-Identifier: Apache-2.0
"""What pages may say, and what they may not."""

import json
from typing import Any

import numpy as np
import pytest

from noninteract_ros.console.page_input import PageDrag, PagePush
from noninteract_ros.console.protocol import KINDS, held, parse
from noninteract_ros.errors import InputError

NO_TURN = [0.0, 0.0, 0.0, 1.0]
GOOD: dict[str, dict[str, Any]] = {
    "hello": {"version": 1, "token": "abc"},
    "drag": {"subtask": "a", "element": 0, "grab": 1, "by": [0.1, 0, -2], "turn": NO_TURN},
    "push": {
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
    ("drag", {"by": [0.0, 0.0]}),
    ("drag", {"by": [0.0, 0.0, "0"]}),
    ("drag", {"by": [0.0, 0.0, True]}),
    ("drag", {"by": [0.0, 0.0, 1e9]}),
    ("drag", {"turn": [0.0, 0.0, 0.0, 0.0]}),
    ("drag", {"turn": [0.0, 0.0, 1.0, 1.0]}),
    ("push", {"linear": [1.5, 0.0, 0.0]}),
    ("push", {"angular": None}),
    ("authority", {"source": "nobody"}),
    ("authority", {"source": ["human"]}),
    ("gains", {"name": "inertia"}),
    ("gains", {"values": []}),
    ("gains", {"values": [1.0] * 1000}),
    ("gains", {"values": 1.0}),
    ("pause", {"on": 1}),
]


def text(kind: str, **changes: Any) -> str:
    return json.dumps({"kind": kind} | GOOD.get(kind, {}) | changes)


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_is_taken_as_it_is_meant(kind: str) -> None:
    """A message of the right form comes out as it went in."""
    said = parse(text(kind))
    assert said.kind == kind
    assert dict(said.values) == GOOD.get(kind, {})


@pytest.mark.parametrize(("kind", "changes"), BAD)
def test_a_wrong_value_is_refused(kind: str, changes: dict[str, Any]) -> None:
    """One wrong value makes the whole message wrong."""
    with pytest.raises(InputError, match=f"{kind} with a wrong"):
        parse(text(kind, **changes))


@pytest.mark.parametrize("kind", KINDS)
def test_another_set_of_keys_is_refused(kind: str) -> None:
    """A key too many is refused, and so is one too few."""
    with pytest.raises(InputError, match="other keys"):
        parse(text(kind, more=1))
    for name in GOOD.get(kind, {}):
        content = json.loads(text(kind))
        del content[name]
        with pytest.raises(InputError, match="other keys"):
            parse(json.dumps(content))


@pytest.mark.parametrize(
    "data",
    [
        b"{}",
        "",
        "beat",
        "[]",
        "null",
        '{"kind": "beat"',
        '{"kind": "fly"}',
        '{"kind": ["beat"]}',
        "[" * 4000,
        text("push").replace("0.5", "NaN"),
        text("push").replace("0.5", "Infinity"),
        text("push").replace("0.5", "1e999"),
    ],
)
def test_what_is_no_message_is_refused(data: str | bytes) -> None:
    """No JSON, another kind of JSON, numbers that are none: refused, whatever it is."""
    with pytest.raises(InputError):
        parse(data)


def test_what_is_held_comes_out_as_arrays() -> None:
    """Drags and pushes are things to hold; other messages are not."""
    drag, push = held(parse(text("drag"))), held(parse(text("push")))
    assert isinstance(drag, PageDrag)
    assert isinstance(push, PagePush)
    np.testing.assert_array_equal(drag.by, [0.1, 0.0, -2.0])
    np.testing.assert_array_equal(push.linear, [1.0, -1.0, 0.5])
    assert held(parse(text("release"))) is None
