# SPDX-License-Identifier: Apache-2.0
"""Parameter files, checked and rewritten before ROS parses them.

Errors are reported in one line. Three pitfalls of the parser of ROS are removed: it takes `y` for
a boolean, which rejects `axes: [x, y]`, and `[0, 1.5]` for a list of mixed types, and it drops
empty lists. Those become lists of one empty text, which `ScenarioNode` reads as empty.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

from noninteract_ros.errors import ScenarioError
from noninteract_ros.scenario.files import nest, read_yaml
from noninteract_ros.scenario.yaml_text import YamlTextError, parse_yaml

OPTION = "--params-file"
OVERRIDES = ("-p", "--param")
COMMAND_LINE = "-p"
EVERY_NODE = "/**"
TEXT_KEYS = ("output", "scenario_file", "urdf")  # On a command line their values need no quotes.
EMPTY_LIST = [""]  # The parser of ROS drops lists without items.


class _Quoted(yaml.SafeDumper):
    """YAML dumper that quotes every string, so that no parser takes it for another type."""

    def ignore_aliases(self, data: object) -> bool:
        """Return True: the parser of ROS knows no aliases."""
        return True


_Quoted.add_representer(
    str, lambda dumper, text: dumper.represent_scalar("tag:yaml.org,2002:str", text, style='"')
)


def files_of(arguments: Sequence[str]) -> list[str]:
    """Return the files named by `--params-file` on a ROS command line."""
    return [value for option, value in pairwise(arguments) if option == OPTION]


def rewrite(arguments: Sequence[str], folder: Path) -> list[str]:
    """Return the command line with its parameters rewritten for the parser of ROS.

    Args:
        arguments: ROS command line.
        folder: Folder for the rewritten files.

    Raises:
        ScenarioError: A file is missing, is not YAML, is not a parameter file, or a list has mixed
            types. The error names file and key.
    """
    result = list(arguments)
    given: set[tuple[str, str]] = set()
    for place in reversed(range(1, len(result))):
        if result[place - 1] == OPTION:
            content = _drop_overridden(_checked(result[place]), given)
            result[place] = str(folder / f"{place}.yaml")
            Path(result[place]).write_text(dump(content))
        elif result[place - 1] in OVERRIDES:
            given.add((EVERY_NODE, result[place].partition(":=")[0]))
            result[place] = _rewrite_override(result[place])
    return result


def _drop_overridden(block: Mapping[str, Any], given: set[tuple[str, str]], node: str = "") -> Any:
    """Return a parameter file without the keys in `given`, and add its own keys to `given`.

    Where a later value has another type, ROS keeps both and may use the first.
    """
    kept: dict[str, Any] = {}
    for name, value in block.items():
        if name == "ros__parameters":
            leaves = {key: item for key, item in _leaves(value) if (node, key) not in given}
            given.update((node, key) for key in leaves)
            kept[name] = leaves
        else:
            kept[name] = _drop_overridden(value, given, f"{node}/{name}".replace("//", "/"))
    return kept


def _rewrite_override(text: str) -> str:
    """Return `key:=value` with a list, or the value of a text key, for the parser of ROS."""
    key, separator, written = text.partition(":=")
    try:
        value = parse_yaml(written)
    except YamlTextError:
        value = None  # ROS reports the error, except for a text.
    if key.rpartition(":")[2].rpartition(".")[2] in TEXT_KEYS:
        value = value if written[:1] in ("'", '"') and isinstance(value, str) else written
    elif not isinstance(value, list):
        return text
    _check_leaf(key, value, COMMAND_LINE)
    dumped = yaml.dump(_plain(value), Dumper=_Quoted, default_flow_style=True, width=10**6)
    return key + separator + dumped.removesuffix("...\n").strip()


def dump(content: Mapping[str, Any]) -> str:
    """Return the text of a parameter file for the parser of ROS."""
    return yaml.dump(_plain(content), Dumper=_Quoted, sort_keys=False)


def write(file: Path, values: Mapping[str, Any]) -> Path:
    """Write the values of a scenario as a parameter file."""
    file.write_text(dump({EVERY_NODE: {"ros__parameters": dict(values)}}))
    return file


def origin_of_key(arguments: Sequence[str], key: str) -> str | None:
    """Return the origin of a key on a command line: an override, or a file.

    The file is the last one with the block of the key, else the last one. None without files.
    """
    for option, text in pairwise(arguments):
        if option in OVERRIDES and text.partition(":=")[0].rpartition(":")[2] == key:
            return COMMAND_LINE
    paths, head = files_of(arguments), key.split(".")[0]
    for path in reversed(paths):
        if any(item.split(".")[0] == head for item, _ in _leaves(_checked(path))):
            return path
    return paths[-1] if paths else None


def _checked(path: str) -> Mapping[str, Any]:
    content = read_yaml(Path(path))
    if not isinstance(content, Mapping):
        found = "nothing" if content is None else repr(content)
        raise ScenarioError("(file)", found, "node: ros__parameters: ...", path)
    for node, block in content.items():
        _check_node(str(node), block, path)
    for key, value in _leaves(content):
        _check_leaf(key, value, path)
    return content


def _check_node(name: str, block: Any, path: str) -> None:
    """Raise a ScenarioError for values beside `ros__parameters` instead of inside it."""
    if not isinstance(block, Mapping):
        raise ScenarioError(name, repr(block), "a block with ros__parameters", path)
    for key, value in block.items():
        if key != "ros__parameters":
            _check_node(f"{name}.{key}", value, path)
        elif not isinstance(value, Mapping):
            raise ScenarioError(f"{name}.{key}", repr(value), "a block of parameters", path)
        else:
            try:
                nest(value)
            except ScenarioError as error:
                raise ScenarioError(error.key, error.found, error.allowed, path) from error


def _leaves(block: Mapping[Any, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted keys below `ros__parameters` with their values."""
    for key, value in block.items():
        name = f"{path}.{key}" if path else str(key)
        if isinstance(value, Mapping):
            yield from _leaves(value, "" if key == "ros__parameters" else name)
        else:
            yield name, value


def _check_leaf(key: str, value: Any, path: str) -> None:
    if value is None:
        raise ScenarioError(key, "nothing", "a value", path)
    items = value if isinstance(value, list) else [value]
    kinds = {float if type(item) is int else type(item) for item in items}
    if not kinds <= {bool, float, str} or len(kinds) > 1:
        raise ScenarioError(key, repr(value), "numbers, strings, or true and false", path)


def _plain(value: Any) -> Any:
    """Return the content with mixed numbers converted to floats, and empty lists marked."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list) and {type(item) for item in value} == {int, float}:
        return [float(item) for item in value]
    return EMPTY_LIST if value == [] else value
