# SPDX-License-Identifier: Apache-2.0
"""The exceptions of this package; every one is a `NoninteractError`."""

from collections.abc import Iterable
from difflib import get_close_matches


class NoninteractError(Exception):
    """Base of every error that this package raises on purpose."""


class ScenarioError(NoninteractError):
    """A configuration key is missing, unknown, of the wrong type or out of range.

    Attributes:
        key: Full dotted key, e.g. `cooperative.stiffness`.
        file: Parameter file that holds the key, where it is known.
    """

    def __init__(self, key: str, found: object, allowed: str, file: str | None = None) -> None:
        self.key, self.found, self.allowed, self.file = key, found, allowed, file
        super().__init__(key, found, allowed, file)

    def __str__(self) -> str:
        where = f"{self.file}: " if self.file else ""
        return f"{where}{self.key}: found {self.found}, allowed: {self.allowed}"


class TeamError(NoninteractError):
    """The robots cannot be joined into one team."""


class SubtaskError(NoninteractError):
    """The subtasks violate an assumption of the law (the paper's assumptions 1 to 3)."""


class InputError(NoninteractError):
    """A message or an input is refused whole; the text says why."""


class RecordingError(NoninteractError):
    """A recorded run cannot be read or written."""


def one_of(names: Iterable[str], found: str = "") -> str:
    """Lists the valid names, the closest to what was found first."""
    names = list(names)
    close = get_close_matches(found, names, n=1)
    ordered = close + [name for name in names if name not in close]
    return " | ".join(ordered) if ordered else "none"
