# SPDX-License-Identifier: Apache-2.0
"""Exceptions of this package, all derived from `NoninteractError`."""

from collections.abc import Iterable
from difflib import get_close_matches


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
        return f"{where}{self.key}: found {self.found}, allowed: {self.allowed}"


class TeamError(NoninteractError):
    """Error for robots that cannot be joined into one team."""


class SubtaskError(NoninteractError):
    """Error for subtasks that violate one of the paper's assumptions 1 to 3."""


class InputError(NoninteractError):
    """Error for a rejected message or input; the text gives the reason."""


class RecordingError(NoninteractError):
    """Error for a recording that cannot be read or written."""


def one_of(names: Iterable[str], found: str = "") -> str:
    """List the valid names, the closest match to `found` first."""
    names = list(names)
    close = get_close_matches(found, names, n=1)
    ordered = close + [name for name in names if name not in close]
    return " | ".join(ordered) if ordered else "none"
