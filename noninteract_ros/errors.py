# SPDX-License-Identifier: Apache-2.0
"""Exceptions of this package, all derived from `NoninteractError`."""

from collections.abc import Iterable
from difflib import get_close_matches

MAX_FOUND, MAX_ALLOWED = 300, 1000  # Characters of the parts of an error.


class NoninteractError(Exception):
    """Base class of all errors that this package raises."""


class ScenarioError(NoninteractError):
    """Error for a configuration key that is missing, unknown, of the wrong type or out of range.

    Attributes:
        key: Full dotted key, e.g. `cooperative.stiffness`.
        found: Value that was given.
        allowed: Values that are accepted.
        file: Parameter file that holds the key; None if unknown.
    """

    def __init__(self, key: str, found: object, allowed: str, file: str | None = None) -> None:
        self.key, self.found, self.allowed, self.file = key, found, allowed, file
        super().__init__(key, found, allowed, file)

    def __str__(self) -> str:
        where = f"{self.file}: " if self.file else ""
        key, found = _one_line(self.key, MAX_FOUND), _one_line(self.found, MAX_FOUND)
        allowed = _one_line(self.allowed, MAX_ALLOWED)
        return f"{where}{key}: found {found}, allowed: {allowed}"


class TeamError(NoninteractError):
    """Error for robots that cannot be joined into one team."""


class SubtaskError(NoninteractError):
    """Error for subtasks that violate one of the paper's assumptions 1 to 3."""


class InputError(NoninteractError):
    """Error for a rejected message or input; the text gives the reason."""


class StepError(NoninteractError):
    """Error inside a control step or an integration step; the program cannot go on."""


class RecordingError(NoninteractError):
    """Error for a recording that cannot be read or written."""


def one_of(names: Iterable[str], found: str = "") -> str:
    """List the valid names, the closest match to `found` first."""
    names = list(names)
    close = get_close_matches(found, names, n=1)
    ordered = close + [name for name in names if name not in close]
    return " | ".join(ordered) if ordered else "none"


def _one_line(part: object, length: int) -> str:
    """Return a part of an error as one line of limited length."""
    text = " ".join(str(part).split())
    return text if len(text) <= length else text[: length - 3] + "..."
