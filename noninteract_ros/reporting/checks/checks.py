# SPDX-License-Identifier: Apache-2.0
"""What a run must show: values against limits, or the reason why a claim does not apply."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Check:
    """One claim about a run.

    Attributes:
        name: What is claimed, e.g. `closed_form.relative`.
        value: What was found; None where the claim does not apply.
        limit: The bound.
        unit: Unit of both.
        passed: Whether the claim holds; None where it does not apply.
        reason: Why it does not apply, or an empty text.
        at_least: Whether the limit is a lower bound.
    """

    name: str
    value: float | None
    limit: float
    unit: str
    passed: bool | None
    reason: str = ""
    at_least: bool = False

    def as_dict(self) -> dict[str, Any]:
        """As it stands in `metrics.json`."""
        return {
            "name": self.name,
            "value": self.value,
            "bound": ">=" if self.at_least else "<=",
            "limit": self.limit,
            "unit": self.unit,
            "passed": self.passed,
            "reason": self.reason or None,
        }


def at_most(name: str, value: float, limit: float, unit: str) -> Check:
    """A value that must not exceed a limit; one that is no number fails."""
    return Check(name, float(value), limit, unit, bool(value <= limit))


def at_least(name: str, value: float, limit: float, unit: str) -> Check:
    """A value that must not fall below a limit; one that is no number fails."""
    return Check(name, float(value), limit, unit, bool(value >= limit), at_least=True)


def not_applicable(name: str, limit: float, unit: str, reason: str) -> Check:
    """A claim that this run can neither confirm nor refute."""
    return Check(name, None, limit, unit, None, reason)
