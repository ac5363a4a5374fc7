# SPDX-License-Identifier: Apache-2.0
"""Registry of the kinds of subtask that a scenario can name.

A kind is a frozen dataclass of `schema.key` fields, one of them `kind: str`, with a method
`build(name, team, others)` that returns a `Subtask`; `others` are the subtasks listed before it,
by name. A scenario names a kind by its import path, `kind: my_package.my_module:MyKind`, or by
the name registered with `register_kind`.
"""

from collections.abc import Mapping
from dataclasses import is_dataclass
from importlib import import_module
from typing import Protocol, cast

from noninteract_ros.errors import ScenarioError, one_of
from noninteract_ros.schema import keys_of
from noninteract_ros.subtasks.kinds.cooperative_pose import CooperativeOrientation, CooperativePose
from noninteract_ros.subtasks.kinds.cooperative_position import CooperativePosition
from noninteract_ros.subtasks.kinds.elbow_angle import ElbowAngle
from noninteract_ros.subtasks.kinds.posture import Posture
from noninteract_ros.subtasks.kinds.relative_pose import RelativeOrientation, RelativePose
from noninteract_ros.subtasks.kinds.relative_position import RelativePosition
from noninteract_ros.subtasks.subtask import Subtask
from noninteract_ros.team.team import Team


class SubtaskBlock(Protocol):
    """Configuration block of one subtask: a dataclass of `schema.key` fields that builds it."""

    def build(self, name: str, team: Team, others: Mapping[str, Subtask]) -> Subtask:
        """Return the subtask for a team, given the subtasks that are listed before it, by name."""


SUBTASK_KINDS: dict[str, type[SubtaskBlock]] = {
    "cooperative_position": CooperativePosition,
    "cooperative_orientation": CooperativeOrientation,
    "cooperative_pose": CooperativePose,
    "relative_position": RelativePosition,
    "relative_orientation": RelativeOrientation,
    "relative_pose": RelativePose,
    "posture": Posture,
    "elbow_angle": ElbowAngle,
}


def register_kind(name: str, block: type[SubtaskBlock]) -> None:
    """Register a kind of subtask under a name that scenarios can use.

    Raises:
        ScenarioError: The name is used by another class, or the class is no block.
    """
    if SUBTASK_KINDS.get(name, block) is not block:
        raise ScenarioError("kind", repr(name), f"none of {one_of(SUBTASK_KINDS)}")
    SUBTASK_KINDS[name] = _checked("kind", name, block)


def kind_named(path: str, kind: object) -> type[SubtaskBlock]:
    """Return the block of a kind, by its registered name or its import path `module:Class`.

    Args:
        path: Dotted key that names the kind, for error messages.
        kind: Value of that key.

    Raises:
        ScenarioError: The kind does not exist, its module cannot be imported, or the class is no
            block.
    """
    if isinstance(kind, str) and kind in SUBTASK_KINDS:
        return SUBTASK_KINDS[kind]
    if not isinstance(kind, str) or ":" not in kind:
        found = "nothing" if kind is None else repr(kind)
        allowed = f"{one_of(SUBTASK_KINDS, str(kind))} | my_package.my_module:MyKind"
        raise ScenarioError(path, found, allowed)
    module_name, _, class_name = kind.partition(":")
    try:
        found = getattr(import_module(module_name), class_name)
    except (ImportError, AttributeError, ValueError) as error:
        raise ScenarioError(path, f"{kind!r} ({error})", "a class that can be imported") from error
    return _checked(path, kind, found)


def _checked(path: str, name: str, found: object) -> type[SubtaskBlock]:
    fits = isinstance(found, type) and is_dataclass(found) and hasattr(found, "build")
    if not fits or "kind" not in {item.name for item in keys_of(cast(type, found))}:
        allowed = "a dataclass with a key `kind` and a method `build`"
        raise ScenarioError(path, repr(name), allowed)
    return cast(type[SubtaskBlock], found)
