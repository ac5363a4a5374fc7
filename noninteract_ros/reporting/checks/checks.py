# SPDX-License-Identifier: Apache-2.0
"""Checks: a value against a limit, or the reason why the check does not apply."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Check:
    """Comparison of a value with a limit.

    Attributes:
        name: Name of the check, e.g. `closed_form.relative`.
        value: Measured value; None if the check does not apply.
        limit: Limit of the value.
        unit: Unit of value and limit.
        passed: True if the value keeps the limit; None if the check does not apply.
        reason: Reason why the check does not apply; empty if it does.
        at_least: True if the limit is a lower bound.
    """

    name: str
    value: float | None
    limit: float
    unit: str
    passed: bool | None
    reason: str = ""
    at_least: bool = False

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of `metrics.json`."""
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
    """Check that a value does not exceed a limit; NaN fails."""
    return Check(
        name=name, value=float(value), limit=limit, unit=unit, passed=bool(value <= limit)
    )


def at_least(name: str, value: float, limit: float, unit: str) -> Check:
    """Check that a value does not fall below a limit; NaN fails."""
    return Check(
        name=name,
        value=float(value),
        limit=limit,
        unit=unit,
        passed=bool(value >= limit),
        at_least=True,
    )


def not_applicable(name: str, limit: float, unit: str, reason: str) -> Check:
    """Return a check that this run can neither pass nor fail."""
    return Check(name=name, value=None, limit=limit, unit=unit, passed=None, reason=reason)
