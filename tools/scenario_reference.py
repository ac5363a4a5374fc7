# SPDX-License-Identifier: Apache-2.0
"""Reference of the scenario's keys, made from the blocks that declare them with `schema.key`."""

import re
from collections.abc import Iterator
from dataclasses import MISSING, Field, is_dataclass
from typing import Any, get_args, get_type_hints

from noninteract_ros.scenario.blocks import (
    ROBOT_MODELS,
    SURROUNDINGS,
    General,
    SubtaskSpec,
)
from noninteract_ros.scenario.scenario import Scenario
from noninteract_ros.schema import Key, keys_of
from noninteract_ros.subtasks.kinds.registry import SUBTASK_KINDS
from noninteract_ros.team.joint_settings import JointSettings
from noninteract_ros.team.models.arm_settings import ArmSettings
from noninteract_ros.team.robot_topics import RobotTopics


def _annotated(owner: type, name: str) -> type:
    """Return the block in the annotation of an attribute, as of `Tank | None`."""
    hint = get_type_hints(owner)[name]
    return next(item for item in (hint, *get_args(hint)) if is_dataclass(item))


# Blocks by the names that the page docs/reference/scenario.md has for them.
BLOCKS: dict[str, type] = {
    "general": General,
    "joints": JointSettings,
    "topics": RobotTopics,
    "arms": ArmSettings,
    **ROBOT_MODELS,
    "impedance": _annotated(SubtaskSpec, "impedance"),
    "input": _annotated(SubtaskSpec, "input"),
    **SUBTASK_KINDS,
    "formation": _annotated(Scenario, "formations"),
    "push": _annotated(Scenario, "pushes"),
    **SURROUNDINGS,
    "object": _annotated(Scenario, "held"),
    **{
        name: _annotated(Scenario, name)
        for name in (
            "tank",
            "safety",
            "walls",
            "planner",
            "haptic",
            "link",
            "operator",
            "joy",
            "tracker",
            "keyboard",
            "console",
        )
    },
}
TYPES = {
    float: "number",
    int: "integer",
    bool: "boolean",
    str: "string",
    tuple[float, ...]: "list of numbers",
    tuple[str, ...]: "list of strings",
}
UNIT = re.compile(r" ?\[([^]]+)\]")
HEAD = "| key | type | default | allowed | unit | live | meaning |\n|---|---|---|---|---|---|---|"


def table(name: str) -> str:
    """Return a table of the keys that a block declares itself.

    Args:
        name: One of `BLOCKS`.

    Raises:
        ValueError: A key has no text.
    """
    block = BLOCKS[name]
    hints = get_type_hints(block)
    rows = [_row(name, item, hints[item.name]) for item in own_keys(block)]
    return "\n".join([HEAD, *rows])


def own_keys(block: type) -> Iterator[Field]:
    """Yield the keys of a block that none of its bases declares."""
    inherited = {
        item.name
        for base in block.__mro__[1:]
        if hasattr(base, "__dataclass_fields__")
        for item in keys_of(base)
    }
    return (item for item in keys_of(block) if item.name not in inherited)


def _row(block: str, item: Field, hint: Any) -> str:
    rule: Key = item.metadata["key"]
    if not rule.doc.strip():
        raise ValueError(f"{block}.{item.name} has no text")
    units = UNIT.findall(rule.doc)
    text = UNIT.sub("", rule.doc) if len(units) == 1 else rule.doc
    cells = (
        f"`{item.name}`{{ #{block}.{item.name} }}",
        TYPES[hint],
        _default(item),
        _allowed(hint, rule),
        "; ".join(dict.fromkeys(units)),
        "yes" if rule.live else "",
        _cell(text),
    )
    return "| " + " | ".join(cells) + " |"


def _default(item: Field) -> str:
    if item.default is MISSING:
        return "**required**"
    value = list(item.default) if isinstance(item.default, tuple) else item.default
    if value in ("", []):
        return ""
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, list):
        return f"`[{', '.join(str(entry) for entry in value)}]`"
    return f"`{value}`"


def _allowed(hint: Any, rule: Key) -> str:
    if rule.choices:
        return ", ".join(f"`{choice}`" for choice in rule.choices)
    is_number = hint in (float, int, tuple[float, ...])
    allowed = rule.numbers_allowed() if is_number else ""
    return "" if allowed == "finite" else _cell(allowed)


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;").replace(">", "&gt;")
