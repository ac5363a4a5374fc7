# SPDX-License-Identifier: Apache-2.0
"""Parameter files, read before ROS reads them.

What is wrong is said in one clear line, and two traps of ROS's own reader are taken away: there
`y` is a boolean, so that `axes: [x, y]` is refused, and `[0, 1.5]` is a list of unlike items.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

from noninteract_ros.errors import ScenarioError
from noninteract_ros.scenario_file import read_yaml

OPTION = "--params-file"


class _Quoted(yaml.SafeDumper):
    """Writes every text in quotes, so that no reader takes it for anything else."""


_Quoted.add_representer(
    str, lambda dumper, text: dumper.represent_scalar("tag:yaml.org,2002:str", text, style='"')
)


def files_of(arguments: Sequence[str]) -> list[str]:
    """Files that a ROS command line names after `--params-file`."""
    return [value for option, value in pairwise(arguments) if option == OPTION]


def rewrite(arguments: Sequence[str], folder: Path) -> list[str]:
    """The same command line with parameter files that ROS reads as they are meant.

    Args:
        arguments: A ROS command line.
        folder: Where the rewritten files are put.

    Raises:
        ScenarioError: A file is missing, is no YAML, is no parameter file, or holds a list of
            unlike items; the error names the file and the key.
    """
    result = list(arguments)
    for place in range(1, len(result)):
        if result[place - 1] == OPTION:
            content = _checked(result[place])
            result[place] = str(folder / f"{place}.yaml")
            Path(result[place]).write_text(dump(content))
    return result


def dump(content: Mapping[str, Any]) -> str:
    """A parameter file's text that ROS reads as it is meant."""
    return yaml.dump(_plain(content), Dumper=_Quoted, sort_keys=False)


def file_of_key(paths: Sequence[str], key: str) -> str | None:
    """The last of the files that holds a key's block; the last file where none does."""
    head = key.split(".")[0]
    for path in reversed(paths):
        if any(item.split(".")[0] == head for item, _ in _leaves(_checked(path))):
            return path
    return paths[-1] if paths else None


def _checked(path: str) -> Mapping[str, Any]:
    content = read_yaml(Path(path))
    if not isinstance(content, Mapping):
        raise ScenarioError("(file)", type(content).__name__, "node: ros__parameters: ...", path)
    for node, block in content.items():
        if not isinstance(block, Mapping):
            raise ScenarioError(str(node), repr(block), "a block with ros__parameters", path)
    for key, value in _leaves(content):
        _check_leaf(key, value, path)
    return content


def _leaves(block: Mapping[Any, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys below `ros__parameters`, with their values."""
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
        raise ScenarioError(key, repr(value), "numbers, texts, or true and false", path)


def _plain(value: Any) -> Any:
    """The same content with lists of whole and other numbers made one kind."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list) and {type(item) for item in value} == {int, float}:
        return [float(item) for item in value]
    return value
