# SPDX-License-Identifier: Apache-2.0
"""Concatenated ROS message definitions for MCAP schemas (encoding `ros2msg`)."""

import os
import re
import sysconfig
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from noninteract_ros.errors import RecordingError

# Names of messages start with a capital, those of built-in types do not.
_FIELD = re.compile(r"^\s*(?:([a-z]\w*)/)?(?:msg/)?([A-Z]\w*)(?:\[[^\]]*\])?\s+[A-Za-z]")
_SEPARATOR = "=" * 80


@cache
def definition(type_name: str) -> str:
    """Return the definition of a message type with those of all nested types.

    Args:
        type_name: E.g. `sensor_msgs/msg/JointState`.

    Raises:
        RecordingError: The `.msg` file of the type or of a nested type is not installed.
    """
    package, name = _split(type_name)
    parts = {(package, name): _source(package, name)}
    pending = [(package, name)]
    while pending:
        owner = pending.pop(0)
        for used in _used_types(parts[owner], owner[0]):
            if used not in parts:
                parts[used] = _source(*used)
                pending.append(used)
    root, *others = parts.items()
    texts = [root[1]] + [f"MSG: {'/'.join(key)}\n{text}" for key, text in others]
    return f"\n{_SEPARATOR}\n".join(texts)


def _split(type_name: str) -> tuple[str, str]:
    parts = type_name.split("/")
    if len(parts) != 3 or parts[1] != "msg" or not all(parts):
        raise RecordingError(
            f"{type_name!r} is not a message type (like sensor_msgs/msg/JointState)"
        )
    return parts[0], parts[2]


def _used_types(text: str, package: str) -> Iterator[tuple[str, str]]:
    """Yield package and name of each message type among the fields of a definition."""
    for line in text.splitlines():
        if match := _FIELD.match(line.split("#")[0]):
            yield match[1] or package, match[2]


def _source(package: str, name: str) -> str:
    for folder in _share_folders():
        path = folder / package / "msg" / f"{name}.msg"
        if path.is_file():
            return path.read_text(encoding="utf-8")
    raise RecordingError(
        f"no definition of {package}/msg/{name}: share/{package}/msg/{name}.msg is in none of "
        + ", ".join(str(folder.parent) for folder in _share_folders())
    )


def _share_folders() -> list[Path]:
    """Return the `share` folders of message packages: overlays first, then Python's."""
    prefixes = [part for part in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if part]
    return [Path(prefix) / "share" for prefix in [*prefixes, sysconfig.get_path("data")]]
