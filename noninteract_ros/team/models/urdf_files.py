# SPDX-License-Identifier: Apache-2.0
"""Lookup of URDF files: on disk, in ROS packages, in example-robot-data."""

import os
import re
import sys
from difflib import get_close_matches
from pathlib import Path

from noninteract_ros.errors import ScenarioError

SCHEME = "package://"
DECLARATION = re.compile(rb"""\s*<\?xml[^>]*\sencoding\s*=\s*["']([A-Za-z0-9._-]+)["']""")
EXAMPLES = "example-robot-data"
INSTALL = "pip install 'noninteract_ros[robots]'"


def read_urdf(key: str, name: str) -> str:
    """Return the text of a URDF file.

    Args:
        key: Full key of the scenario, for error messages.
        name: A path, relative to the working directory unless it is absolute;
            package://<package>/<path in its share folder>; or example-robot-data/<path>, short
            for package://example-robot-data/robots/<path>.

    Raises:
        ScenarioError: The file does not exist or cannot be read.
    """
    path = _find(key, name)
    try:
        data = path.read_bytes()
        # As the declaration of XML has it; by default, and with a byte order mark, UTF-8.
        declared = DECLARATION.match(data)
        text = data.decode(declared[1].decode() if declared else "utf-8-sig")
        return text.lstrip()
    except (OSError, UnicodeError, LookupError) as error:
        found = f"{name!r}: {getattr(error, 'strerror', None) or 'no text'}"
        raise ScenarioError(key, found, "a readable URDF file") from error


def share_folders() -> list[Path]:
    """Return the share folders of packages: of ROS, of this Python and of its wheels."""
    prefixes = [*filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(":")), sys.prefix]
    wheels = [str(Path(entry, "cmeel.prefix")) for entry in sys.path]
    return [Path(prefix, "share") for prefix in (*prefixes, *wheels)]


def _find(key: str, name: str) -> Path:
    if name.startswith(SCHEME):
        package, _, rest = name.removeprefix(SCHEME).partition("/")
        return _in_package(key, name, package, Path(rest))
    path = Path(name).expanduser()
    if path.is_file():
        return path
    first, *rest_of_path = path.parts or ("",)
    if first == EXAMPLES:
        return _in_package(key, name, EXAMPLES, Path("robots", *rest_of_path))
    allowed = f"a file (relative to {Path.cwd()}), {SCHEME}<package>/<path> or {EXAMPLES}/<path>"
    raise ScenarioError(key, f"no file {name!r}", allowed)


def _in_package(key: str, name: str, package: str, rest: Path) -> Path:
    folders = [share / package for share in share_folders() if (share / package).is_dir()]
    for folder in folders:
        if (folder / rest).is_file():
            return folder / rest
    if folders:
        there = f"a file of {package}: " + _closest(folders, name, package)
        raise ScenarioError(key, f"no file {name!r}", there)
    if package == EXAMPLES:
        allowed = f"an installed package; its robots come with {INSTALL}"
    else:
        allowed = "an installed package in AMENT_PREFIX_PATH or in this Python"
    raise ScenarioError(key, f"{name!r}, but no package {package!r}", allowed)


def _closest(folders: list[Path], name: str, package: str) -> str:
    """Return the URDF files with the most similar names, in the notation of `name`."""
    start, inner = (SCHEME, "") if name.startswith(SCHEME) else ("", "robots")
    known = [
        f"{start}{package}/{file.relative_to(folder / inner).as_posix()}"
        for folder in folders
        for file in (folder / inner).rglob("*.urdf")
    ]
    return " | ".join(get_close_matches(name, known, n=3, cutoff=0.0)) or "none"
