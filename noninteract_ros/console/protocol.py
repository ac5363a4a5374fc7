# SPDX-License-Identifier: Apache-2.0
"""What pages may say: one JSON object a message, checked whole; anything else ends the talk."""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from noninteract_ros.console.page_input import Held, PageDrag, PagePush
from noninteract_ros.errors import InputError
from noninteract_ros.subtasks.layout import UNIT_TOLERANCE

VERSION = 1
LONGEST_TEXT = 128
MOST_NUMBERS = 256
MOST_GRABS = 2**31
FARTHEST = 1000.0  # [m]

Check = Callable[[Any], bool]


def _text(value: Any) -> bool:
    return isinstance(value, str) and len(value) <= LONGEST_TEXT


def _flag(value: Any) -> bool:
    return isinstance(value, bool)


def _count(value: Any) -> bool:
    return type(value) is int and 0 <= value < MOST_GRABS


def _number(value: Any, bound: float) -> bool:
    return type(value) in (int, float) and math.isfinite(value) and abs(value) <= bound


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
        and 1 <= len(value) <= MOST_NUMBERS
        and all(_number(item, 1e9) for item in value)
    )


def _one_of(*names: str) -> Check:
    return lambda value: value in names and isinstance(value, str)


KINDS: dict[str, dict[str, Check]] = {
    "hello": {"version": _count, "token": _text},
    "beat": {},
    "take": {},
    "leave": {},
    "drag": {
        "subtask": _text,
        "element": _count,
        "grab": _count,
        "by": _numbers(3, FARTHEST),
        "turn": _quaternion,
    },
    "push": {
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
    """A message that has the right form.

    Attributes:
        kind: One of `KINDS`.
        values: What the kind has.
    """

    kind: str
    values: Mapping[str, Any]


def parse(data: str | bytes) -> PageCommand:
    """A page's message.

    Raises:
        InputError: It has not the form of any kind.
    """
    if not isinstance(data, str):
        raise InputError("binary message")
    try:
        content = json.loads(data, parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise InputError("no JSON") from error
    if not isinstance(content, dict):
        raise InputError("no object")
    kind = content.pop("kind", None)
    if not isinstance(kind, str) or kind not in KINDS:
        raise InputError("unknown kind")
    checks = KINDS[kind]
    if content.keys() != checks.keys():
        raise InputError(f"{kind} with other keys")
    for name, check in checks.items():
        if not check(content[name]):
            raise InputError(f"{kind} with a wrong {name}")
    return PageCommand(kind, content)


def held(said: PageCommand) -> Held | None:
    """What a message says is held; None where it says something else."""
    values = said.values
    if said.kind == "drag":
        turn = np.array(values["turn"], dtype=float)
        by = np.array(values["by"], dtype=float)
        unit = turn / np.linalg.norm(turn)
        return PageDrag(values["subtask"], values["element"], values["grab"], by, unit)
    if said.kind == "push":
        linear = np.array(values["linear"], dtype=float)
        angular = np.array(values["angular"], dtype=float)
        return PagePush(values["subtask"], values["element"], values["grab"], linear, angular)
    return None


def _refuse(constant: str) -> Any:
    raise ValueError(constant)
