# SPDX-License-Identifier: Apache-2.0
"""Configuration blocks: frozen dataclasses whose fields declare type, range and meaning.

`load` reads a block from a mapping. The same field metadata describes the ROS parameter, so each
key, its range and its documentation are declared in one place.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from typing import Any, TypeVar, get_type_hints

from noninteract_ros.errors import ScenarioError, one_of

Block = TypeVar("Block")
MAX_SHOWN = 80  # Characters of a value in an error.
MAX_NUMBER = 1e9  # In any unit; products of larger ones are no longer accurate.


@dataclass(frozen=True)
class Key:
    """Description and constraints of one configuration key.

    Attributes:
        doc: Description for users: a noun phrase with the unit in brackets.
        minimum: Smallest allowed number, inclusive unless `strict`.
        maximum: Largest allowed number, inclusive.
        strict: True if `minimum` itself is not allowed.
        choices: Allowed strings; empty if any string is allowed.
        live: True if the parameter may be changed while the program runs.
    """

    doc: str
    minimum: float = -math.inf
    maximum: float = math.inf
    strict: bool = False
    choices: tuple[str, ...] = ()
    live: bool = False

    def numbers_allowed(self) -> str:
        """Return the allowed range as text, e.g. `> 0 and <= 10`."""
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
    """Declare one key of a block; a key without a default is required.

    Args:
        doc: Description for users: a noun phrase with the unit in brackets.
        default: Value if the key is not given.
        minimum: Smallest allowed number, inclusive.
        maximum: Largest allowed number, inclusive.
        positive: True if numbers must be greater than 0.
        choices: Allowed strings; empty if any string is allowed.
        live: True if the parameter may be changed while the program runs.
    """
    low = 0.0 if positive else minimum
    metadata = {"key": Key(doc, low, maximum, positive, choices, live)}
    return field(default=default, metadata=metadata)


def load(
    block: type[Block], values: Mapping[str, Any], path: str = "", ignore: tuple[str, ...] = ()
) -> Block:
    """Build a block from a mapping and check every key.

    Args:
        block: Dataclass whose fields are declared with `key`.
        values: Values by key, as read from a parameter file.
        path: Dotted prefix for error messages.
        ignore: Keys of `values` that belong to other blocks.

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
    """Return the fields of a block that are configuration keys."""
    return (item for item in fields(block) if "key" in item.metadata)


def describe(block: Any, path: str = "") -> Iterator[tuple[str, Any, Key, Any]]:
    """Iterate over dotted key, annotated type, `Key` and value of every key of a block."""
    hints = get_type_hints(type(block))
    for item in keys_of(type(block)):
        rule = item.metadata["key"]
        yield join(path, item.name), hints[item.name], rule, getattr(block, item.name)


def join(path: str, name: str) -> str:
    """Return the dotted key of a name within a block."""
    return f"{path}.{name}" if path else str(name)


def convert(path: str, value: Any, hint: Any, rule: Key) -> Any:
    """Check one value and convert it to the annotated type (int to float, list to tuple).

    Raises:
        ScenarioError: The value has the wrong type or is out of range.
    """
    if hint in (tuple[float, ...], tuple[str, ...]):
        item_type = float if hint == tuple[float, ...] else str
        items = _plain(value)
        if not isinstance(items, (list, tuple)):
            raise ScenarioError(path, _show(value), type_name(hint))
        return tuple(_convert_item(path, item, item_type, rule, value) for item in items)
    return _convert_item(path, value, hint, rule, value)


def _convert_item(path: str, item: Any, hint: Any, rule: Key, shown: Any) -> Any:
    if hint is float and type(item) is int and abs(item) <= MAX_NUMBER:
        item = float(item)
    if type(item) is not hint:
        raise ScenarioError(path, _show(shown), type_name(hint))
    if hint in (float, int):
        too_low = item < rule.minimum or (rule.strict and item == rule.minimum)
        if not abs(item) <= MAX_NUMBER or too_low or item > rule.maximum:
            raise ScenarioError(path, _show(shown), f"{type_name(hint)} {rule.numbers_allowed()}")
    if hint is str and rule.choices and item not in rule.choices:
        raise ScenarioError(path, _show(shown), one_of(rule.choices, item))
    return item


def _plain(value: Any) -> Any:
    """Convert an array to a list; return any other value unchanged."""
    return value.tolist() if hasattr(value, "tolist") else value


def _show(value: Any) -> str:
    value = _plain(value)
    text = repr(value[:MAX_SHOWN] if isinstance(value, (list, tuple, str)) else value)
    return text if len(text) <= MAX_SHOWN else text[: MAX_SHOWN - 3] + "..."


def type_name(hint: Any) -> str:
    """Return the type as text for users."""
    names = {
        float: "a number",
        int: "a whole number",
        bool: "true or false",
        str: "a text",
        tuple[float, ...]: "a list of numbers",
        tuple[str, ...]: "a list of names",
    }
    return names.get(hint, str(hint))
