# SPDX-License-Identifier: Apache-2.0
"""Scenario files: lookup, and content as nested values."""

import os
import sys
import sysconfig
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from noninteract_ros.errors import ScenarioError, one_of
from noninteract_ros.scenario.scenario import Scenario
from noninteract_ros.scenario.yaml_text import YamlTextError, parse_yaml
from noninteract_ros.schema import join

PACKAGE = "noninteract_ros"


def load_scenario(path: Path) -> Scenario:
    """Load and validate the scenario of a file.

    Raises:
        ScenarioError: The file is invalid; the error names the file and the key.
    """
    try:
        return Scenario.from_dict(read_parameters(path))
    except ScenarioError as error:
        if error.file:
            raise
        raise ScenarioError(error.key, error.found, error.allowed, str(path)) from error


def read_parameters(path: Path) -> dict[str, Any]:
    """Return the nested parameters of a scenario file, merged over all its nodes.

    Raises:
        ScenarioError: The file is missing or is no parameter file.
    """
    try:
        return parameters_of(read_yaml(path))
    except ScenarioError as error:
        raise ScenarioError(error.key, error.found, error.allowed, str(path)) from error


def parameters_of(content: Any) -> dict[str, Any]:
    """Return the nested parameters of a parameter file's content, merged over all its nodes.

    Raises:
        ScenarioError: The content is that of no parameter file, or has a key twice.
    """
    parameters: dict[str, Any] = {}
    for node, block in content.items() if isinstance(content, Mapping) else ():
        if not isinstance(block, Mapping) or "ros__parameters" not in block:
            raise ScenarioError("(file)", "no ros__parameters", "/**: ros__parameters:")
        values = block["ros__parameters"]
        if not isinstance(values, Mapping):
            found = "nothing" if values is None else repr(values)
            raise ScenarioError(f"{node}.ros__parameters", found, "a block of parameters")
        parameters = _merge(parameters, nest(values))
    return parameters


def read_yaml(path: Path) -> Any:
    """Return the content of a YAML file.

    Raises:
        ScenarioError: The file cannot be read or is no YAML.
    """
    try:
        return parse_yaml(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise ScenarioError("(file)", error.strerror, "a readable file", str(path)) from error
    except UnicodeDecodeError as error:
        raise ScenarioError("(file)", "no UTF-8 text", "a YAML file", str(path)) from error
    except YamlTextError as error:
        raise ScenarioError("(file)", error, "a YAML file", str(path)) from error


def nest(values: Mapping[str, Any]) -> dict[str, Any]:
    """Convert dotted keys to nested blocks.

    Raises:
        ScenarioError: A key is given twice, as `a.b` and as `b` in the block `a`.
    """
    nested: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            value = nest(value)
        first, *rest = str(name).split(".")
        for part in reversed(rest):
            value = {part: value}
        nested = _merge(nested, {first: value}, unique=True)
    return nested


def _merge(
    old: Mapping[str, Any], new: Mapping[str, Any], unique: bool = False, path: str = ""
) -> dict[str, Any]:
    """Return nested values with others merged; with `unique` they must not have a key twice."""
    merged = dict(old)
    for key, value in new.items():
        name = join(path, key)
        if key not in merged:
            merged[key] = value
        elif isinstance(value, Mapping) and isinstance(merged[key], Mapping):
            merged[key] = _merge(merged[key], value, unique, name)
        elif unique:
            raise ScenarioError(name, "the key twice", "one value")
        else:
            merged[key] = value
    return merged


def for_console(values: Mapping[str, Any], port: int) -> dict[str, Any]:
    """Return a scenario with a person at the console as its human source.

    It runs in lockstep, limited to wall time: on a machine too slow for the control rate it runs
    slower, with the same result. The controller does not wait for the person, and no other source
    replaces them.
    """
    changed = {name: item for name, item in values.items() if name != "haptic"}
    sources = values.get("lockstep_sources", ())
    changed |= {
        "lockstep": True,
        "real_time": True,
        "lockstep_sources": [name for name in sources if not name.endswith("/human")],
        "console": {**values.get("console", {}), "port": port},
    }
    for name in values["subtasks"]:
        changed[name] = {**values[name], "takeover": "shaped"}
    return changed


def config_folders() -> list[Path]:
    """Return the folders of the package's scenarios: source tree, ROS prefixes, installation."""
    prefixes = [*filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(":")), sys.prefix]
    shares = [Path(prefix, "share") for prefix in prefixes] + [
        Path(sysconfig.get_path("data"), "share")
    ]
    source = Path(__file__).parents[2] / "config"
    return [source, *(share / PACKAGE / "config" for share in shares)]


def known_scenarios() -> dict[str, Path]:
    """Return the files of all scenarios that can be given by name."""
    known: dict[str, Path] = {}
    for folder in reversed(config_folders()):
        known.update({file.stem: file for file in sorted(folder.glob("*.yaml"))})
    return known


def find_scenario(name: str) -> Path:
    """Return the file of a scenario given by its path or by its name.

    Raises:
        ScenarioError: The scenario does not exist; the error lists the known names.
    """
    if Path(name).is_file():
        return Path(name)
    known = known_scenarios()
    if name not in known:
        raise ScenarioError("scenario", repr(name), f"a file, or {one_of(sorted(known), name)}")
    return known[name]
