# SPDX-License-Identifier: Apache-2.0
"""Reader of YAML for scenario and parameter files.

It differs from PyYAML's safe loader where that surprises in a file of gains:

* `1e3` is a number, as in YAML 1.2 and for the parser of ROS.
* Keys are text as written: `no` and `1` are names. A key that is given twice is an error.
* Only null, booleans, numbers, texts, lists and blocks exist; a date is a text.
* Depth and size are limited, with the copies of anchors counted, and an anchor cannot contain
  itself.
"""

import re
from typing import Any

import yaml
from yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

MAX_DEPTH = 32
MAX_VALUES = 200_000
MAX_INTEGER = 2**63 - 1  # As in ROS.
MAX_SHOWN = 80  # Characters of a key in an error.
TAG = "tag:yaml.org,2002:"
MERGE = TAG + "merge"
KEPT_TAGS = ("null", "bool", "int", "float", "str", "seq", "map")
KEPT_RESOLVERS = {TAG + name for name in ("null", "bool", "int", "merge")}
NUMBER = re.compile(
    r"[-+]?(?:[0-9][0-9_]*\.?[0-9_]*|\.[0-9][0-9_]*)(?:[eE][-+]?[0-9]+)?|[-+]?\.(?:inf|Inf|INF)"
    r"|\.(?:nan|NaN|NAN)"
)


class YamlTextError(Exception):
    """Error for a text that is no YAML of a parameter file; one short line."""


class _Loader(yaml.SafeLoader):
    """YAML loader described in the module's docstring."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._depth = 0

    def compose_node(self, parent: Node | None, index: Any) -> Node | None:
        """Compose a node within the limit of depth."""
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise YamlTextError(f"{_line(self.peek_event())}: more than {MAX_DEPTH} levels")
        node: Node | None = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def compose_mapping_node(self, anchor: Any) -> MappingNode:
        """Compose a block with text keys, each given once."""
        node: MappingNode = super().compose_mapping_node(anchor)
        lines: dict[str, str] = {}
        for key, _ in node.value:
            if not isinstance(key, ScalarNode):
                raise YamlTextError(f"{_line(key)}: a key that is no text")
            if key.tag == MERGE:
                continue
            key.tag = TAG + "str"
            if key.value in lines:
                text = f"{_line(key)}: key {key.value[:MAX_SHOWN]!r} is given twice, first in "
                raise YamlTextError(text + lines[key.value])
            lines[key.value] = _line(key)
        return node


def _text(loader: _Loader, node: ScalarNode) -> str:
    text = loader.construct_scalar(node)
    if "\0" in text or not _is_unicode(text):
        raise YamlTextError(f"{_line(node)}: a text with characters that no file can hold")
    return text


def _integer(loader: _Loader, node: ScalarNode) -> int | float | str:
    if ":" in node.value:  # A number to the base 60 in YAML 1.1 alone.
        return _text(loader, node)
    try:
        value: int = loader.construct_yaml_int(node)
    except ValueError:  # Too many digits for Python; or `0_`.
        return _float(loader, node)
    return value if abs(value) <= MAX_INTEGER else _float(loader, node)


def _float(loader: _Loader, node: ScalarNode) -> float:
    try:
        return loader.construct_yaml_float(node)
    except (ValueError, OverflowError) as error:
        raise YamlTextError(f"{_line(node)}: {node.value[:MAX_SHOWN]!r} is no number") from error


_Loader.yaml_implicit_resolvers = {
    first: [item for item in resolvers if item[0] in KEPT_RESOLVERS]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_Loader.yaml_constructors = {
    **{TAG + name: yaml.SafeLoader.yaml_constructors[TAG + name] for name in KEPT_TAGS},
    None: yaml.SafeLoader.yaml_constructors[None],
    TAG + "str": _text,
    TAG + "int": _integer,
    TAG + "float": _float,
}
# After the integers, whose pattern is part of this one.
_Loader.add_implicit_resolver(
    TAG + "float", re.compile(f"(?:{NUMBER.pattern})$"), [*"-+.0123456789"]
)


def parse_yaml(text: str) -> Any:
    """Return the content of a YAML text.

    Raises:
        YamlTextError: The text is no YAML, or has a key twice, too many levels or values, a
            type that parameters do not have, or an anchor that contains itself.
    """
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        if node is None:
            return None
        if _size(node, {}) > MAX_VALUES:
            raise YamlTextError(f"more than {MAX_VALUES} values")
        return loader.construct_document(node)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}: " if mark else ""
        raise YamlTextError(where + _short(error.problem or error.context or "no YAML")) from error
    except yaml.YAMLError as error:
        raise YamlTextError(_short(str(error))) from error
    except (ArithmeticError, LookupError, RecursionError, TypeError, ValueError) as error:
        raise YamlTextError(f"no YAML of parameters ({_short(str(error))})") from error


def _size(node: Node, sizes: dict[int, int | None]) -> int:
    """Return the number of values of a node, with each alias counted as a copy."""
    known = sizes.get(id(node), 0)
    if known is None:
        raise YamlTextError(f"{_line(node)}: an anchor that contains itself")
    if known:
        return known
    sizes[id(node)] = None
    parts: list[Node] = []
    if isinstance(node, SequenceNode):
        parts = node.value
    elif isinstance(node, MappingNode):
        parts = [part for pair in node.value for part in pair]
    size = 1 + sum(_size(part, sizes) for part in parts)
    sizes[id(node)] = size
    return size


def _line(item: Any) -> str:
    return f"line {item.start_mark.line + 1}"


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= 2 * MAX_SHOWN else text[: 2 * MAX_SHOWN - 3] + "..."


def _is_unicode(text: str) -> bool:
    """Return True if a text has no half of a surrogate pair."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True
