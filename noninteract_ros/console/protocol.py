# SPDX-License-Identifier: Apache-2.0
"""Messages from pages: one JSON object each; an invalid message closes the connection."""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from noninteract_ros.console.held_input import HeldInput, PageDrag, PageTwist
from noninteract_ros.errors import InputError
from noninteract_ros.subtasks.layout import UNIT_TOLERANCE

VERSION = 2
MAX_TEXT_LENGTH = 128
MAX_GAINS = 256
MAX_COUNT = 2**31
MAX_DISTANCE = 1000.0  # [m]

Check = Callable[[Any], bool]


def _text(value: Any) -> bool:
    if not isinstance(value, str) or len(value) > MAX_TEXT_LENGTH:
        return False
    # JSON can hold halves of surrogate pairs and NUL, which no message of ROS can.
    return not any(character == "\0" or "\ud800" <= character <= "\udfff" for character in value)


def _flag(value: Any) -> bool:
    return isinstance(value, bool)


def _count(value: Any) -> bool:
    return type(value) is int and 0 <= value < MAX_COUNT


def _number(value: Any, bound: float) -> bool:
    return type(value) in (int, float) and abs(value) <= bound  # False for NaN


def _numbers(count: int, bound: float) -> Check:
    return lambda value: (
        isinstance(value, list)
        and len(value) == count
        and all(_number(item, bound) for item in value)
    )


def _quaternion(value: Any) -> bool:
    return _numbers(4, 1.1)(value) and abs(math.hypot(*value) - 1.0) <= UNIT_TOLERANCE


def _gains(value: Any) -> bool:
    return (
        isinstance(value, list)
        and 1 <= len(value) <= MAX_GAINS
        and all(_number(item, 1e9) for item in value)
    )


def _one_of(*names: str) -> Check:
    return lambda value: value in names and isinstance(value, str)


KINDS: dict[str, dict[str, Check]] = {
    "hello": {"version": _count, "token": _text},
    "heartbeat": {},
    "take_control": {},
    "release_control": {},
    "drag": {
        "subtask": _text,
        "element": _count,
        "grab": _count,
        "translation": _numbers(3, MAX_DISTANCE),
        "rotation": _quaternion,
    },
    "twist": {
        "subtask": _text,
        "element": _count,
        "grab": _count,
        "linear": _numbers(3, 1.0),
        "angular": _numbers(3, 1.0),
    },
    "release": {},
    "stop": {},
    "resume": {},
    "authority": {"subtask": _text, "source": _one_of("human", "autonomy", "hold")},
    "law": {"law": _text},
    "gains": {"subtask": _text, "name": _one_of("stiffness", "damping"), "values": _gains},
    "pause": {"on": _flag},
    "step": {},
    "reset": {},
    "refill": {},
}


@dataclass(frozen=True, slots=True)
class PageCommand:
    """A valid message of a page.

    Attributes:
        kind: One of `KINDS`.
        values: Values of the kind's keys.
    """

    kind: str
    values: Mapping[str, Any]


def parse(data: str | bytes) -> PageCommand:
    """Parse a message of a page.

    Raises:
        InputError: The message does not have the form of any kind.
    """
    if not isinstance(data, str):
        raise InputError("binary message")
    try:
        content = json.loads(data, parse_constant=_reject_constant)
    except (ValueError, RecursionError) as error:
        raise InputError("not JSON") from error
    if not isinstance(content, dict):
        raise InputError("not a JSON object")
    kind = content.pop("kind", None)
    if not isinstance(kind, str) or kind not in KINDS:
        raise InputError("unknown kind")
    checks = KINDS[kind]
    if content.keys() != checks.keys():
        raise InputError(f"{kind}: missing or unknown keys")
    for name, check in checks.items():
        if not check(content[name]):
            raise InputError(f"{kind}: invalid {name}")
    return PageCommand(kind, content)


def held_input(command: PageCommand) -> HeldInput | None:
    """Return the input that a message holds, or None if it is a message of another kind."""
    values = command.values
    if command.kind == "drag":
        rotation = np.array(values["rotation"], dtype=float)
        return PageDrag(
            subtask=values["subtask"],
            element=values["element"],
            grab=values["grab"],
            translation=np.array(values["translation"], dtype=float),
            rotation=rotation / np.linalg.norm(rotation),
        )
    if command.kind == "twist":
        return PageTwist(
            subtask=values["subtask"],
            element=values["element"],
            grab=values["grab"],
            linear=np.array(values["linear"], dtype=float),
            angular=np.array(values["angular"], dtype=float),
        )
    return None


def _reject_constant(constant: str) -> Any:
    raise ValueError(constant)
