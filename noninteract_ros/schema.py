# SPDX-License-Identifier: Apache-2.0
"""Configuration blocks: frozen dataclasses whose fields carry type, range and meaning.

A block is read from a mapping with `load`; the same field metadata describes the ROS parameter,
so that a key, its range and its documentation have one home.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from typing import Any, TypeVar, get_type_hints

from noninteract_ros.errors import ScenarioError, one_of

Block = TypeVar("Block")


@dataclass(frozen=True)
class Key:
    """What one configuration key means and what it may hold.

    Attributes:
        doc: One line for people, with the unit in brackets.
        minimum: Smallest value of each number, inclusive (exclusive where `strict`).
        maximum: Largest value of each number, inclusive.
        strict: Whether `minimum` itself is refused.
        choices: Names that a string may take; any, where empty.
        live: Whether the parameter may be changed while the program runs.
    """

    doc: str
    minimum: float = -math.inf
    maximum: float = math.inf
    strict: bool = False
    choices: tuple[str, ...] = ()
    live: bool = False

    def numbers_allowed(self) -> str:
        """The allowed range in words."""
        low = (
            f"{'>' if self.strict else '>='} {self.minimum:g}" if self.minimum > -math.inf else ""
        )
        high = f"<= {self.maximum:g}" if self.maximum < math.inf else ""
        return " and ".join(part for part in (low, high) if part) or "finite"


def key(
    doc: str,
    default: Any = MISSING,
    *,
    minimum: float = -math.inf,
    maximum: float = math.inf,
    positive: bool = False,
    choices: tuple[str, ...] = (),
    live: bool = False,
) -> Any:
    """Declares one key of a block; without a default the key must be given."""
    low = 0.0 if positive else minimum
    metadata = {"key": Key(doc, low, maximum, positive, choices, live)}
    return field(default=default, metadata=metadata)


def load(
    block: type[Block], values: Mapping[str, Any], path: str = "", ignore: tuple[str, ...] = ()
) -> Block:
    """Builds a block from a mapping and checks every key.

    Args:
        block: Dataclass whose fields were declared with `key`.
        values: Key to value, as read from a parameter file.
        path: Dotted prefix for error messages.
        ignore: Keys of `values` that belong to somebody else.

    Raises:
        ScenarioError: A key is unknown, missing, of the wrong type or out of range.
    """
    hints = get_type_hints(block)
    known = {item.name: item for item in keys_of(block)}
    for name in values:
        if name not in known and name not in ignore:
            raise ScenarioError(join(path, name), "an unknown key", one_of(known, str(name)))
    arguments = {}
    for name, item in known.items():
        if name in values:
            arguments[name] = convert(
                join(path, name), values[name], hints[name], item.metadata["key"]
            )
        elif item.default is MISSING:
            raise ScenarioError(
                join(path, name), "nothing", f"{type_name(hints[name])} (required)"
            )
    return block(**arguments)


def keys_of(block: type) -> Iterator[Field]:
    """The fields of a block that are configuration keys."""
    return (item for item in fields(block) if "key" in item.metadata)


def describe(block: Any, path: str = "") -> Iterator[tuple[str, Any, Key, Any]]:
    """Dotted key, annotated type, rule and value of every key of a block."""
    hints = get_type_hints(type(block))
    for item in keys_of(type(block)):
        rule = item.metadata["key"]
        yield join(path, item.name), hints[item.name], rule, getattr(block, item.name)


def join(path: str, name: str) -> str:
    """Dotted key."""
    return f"{path}.{name}" if path else str(name)


def convert(path: str, value: Any, hint: Any, rule: Key) -> Any:
    """Checks one value and converts it to the annotated type (int to float, list to tuple)."""
    if hint in (tuple[float, ...], tuple[str, ...]):
        item_type = float if hint == tuple[float, ...] else str
        items = _plain(value)
        if not isinstance(items, (list, tuple)):
            raise ScenarioError(path, _show(value), type_name(hint))
        return tuple(_convert_item(path, item, item_type, rule, value) for item in items)
    return _convert_item(path, value, hint, rule, value)


def _convert_item(path: str, item: Any, hint: Any, rule: Key, shown: Any) -> Any:
    if hint is float and isinstance(item, int) and not isinstance(item, bool):
        item = float(item)
    if type(item) is not hint:
        raise ScenarioError(path, _show(shown), type_name(hint))
    if hint in (float, int):
        too_low = item < rule.minimum or (rule.strict and item == rule.minimum)
        if not math.isfinite(item) or too_low or item > rule.maximum:
            raise ScenarioError(path, _show(shown), f"{type_name(hint)} {rule.numbers_allowed()}")
    if hint is str and rule.choices and item not in rule.choices:
        raise ScenarioError(path, _show(shown), one_of(rule.choices, item))
    return item


def _plain(value: Any) -> Any:
    """Arrays as lists."""
    return value.tolist() if hasattr(value, "tolist") else value


def _show(value: Any) -> str:
    text = repr(_plain(value))
    return text if len(text) <= 80 else text[:77] + "..."


def type_name(hint: Any) -> str:
    """The type in words."""
    names = {
        float: "a number",
        int: "a whole number",
        bool: "true or false",
        str: "a text",
        tuple[float, ...]: "a list of numbers",
        tuple[str, ...]: "a list of names",
    }
    return names.get(hint, str(hint))
