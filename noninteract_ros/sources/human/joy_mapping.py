# SPDX-License-Identifier: Apache-2.0
"""Mapping of the axes and buttons of a Joy message to deflections."""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.errors import InputError, ScenarioError
from noninteract_ros.schema import join
from noninteract_ros.sources.human.input_settings import JoySettings
from noninteract_ros.sources.human.input_shaping import deflection

DIRECTIONS = ("x", "y", "z", "roll", "pitch", "yaw")
TERM = re.compile(r"\s*([+-]?)\s*(axis|button)\s*(\d+)\s*")
Terms = list[tuple[float, str, int]]


class JoyMapping:
    """Mapping to deflections in six directions and to the state of the dead-man's switch.

    Drivers may omit buttons that are not pressed, as that of space mice does. Missing axes mean
    that the mapping belongs to another device.

    Args:
        settings: The block `joy`.
        path: Dotted key of the block, for error messages.

    Raises:
        ScenarioError: A direction is not a sum of axes and buttons.
    """

    def __init__(self, settings: JoySettings, path: str = "joy") -> None:
        self._settings = settings
        self._terms = [_terms(join(path, name), getattr(settings, name)) for name in DIRECTIONS]
        self._mapped = {
            number for terms in self._terms for _, kind, number in terms if kind == "axis"
        }
        self._axes = max(self._mapped, default=-1) + 1

    def at_rest(self, axes: Sequence[float]) -> NDArray[np.bool_]:
        """Return True for each axis that is in its dead zone or not mapped, shape (axes,)."""
        resting = np.abs(np.array(axes, dtype=float)[: self._axes]) <= self._settings.deadzone
        resting[list(set(range(self._axes)) - self._mapped)] = True
        return resting

    def read(self, axes: Sequence[float], buttons: Sequence[int]) -> tuple[Array, bool]:
        """Convert a message to deflections and the state of the dead-man's switch.

        Returns:
            Deflections along and about x, y, z, shape (6,), and True if the switch is held.
            Without an enable button it is held while a deflection is not zero.

        Raises:
            InputError: There are too few axes, or one is not finite.
        """
        if len(axes) < self._axes:
            raise InputError(f"{len(axes)} axes, the mapping needs {self._axes}")
        values = np.array(axes, dtype=float)
        if not np.isfinite(values).all():
            raise InputError(f"axis {int(np.argmin(np.isfinite(values)))} is not finite")
        settings = self._settings
        shaped = deflection(values, settings.deadzone, settings.exponent)
        stick = np.array([self._sum(terms, shaped, buttons) for terms in self._terms])
        stick = np.clip(stick, -1.0, 1.0)
        if _pressed(buttons, settings.slow_button):
            stick *= settings.slow_factor
        if settings.enable_button < 0:
            return stick, bool(stick.any())
        return stick, _pressed(buttons, settings.enable_button)

    @staticmethod
    def _sum(terms: Terms, axes: Array, buttons: Sequence[int]) -> float:
        return sum(
            sign * (axes[number] if kind == "axis" else float(_pressed(buttons, number)))
            for sign, kind, number in terms
        )


def _pressed(buttons: Sequence[int], number: int) -> bool:
    return 0 <= number < len(buttons) and bool(buttons[number])


def _terms(path: str, text: str) -> Terms:
    """Parse the signed axes and buttons of a direction."""
    terms: Terms = []
    at = 0
    while at < len(text):
        found = TERM.match(text, at)
        if found is None or (at > 0 and not found[1]):
            raise ScenarioError(path, repr(text), "a sum such as axis1, -axis0, button5-button4")
        terms.append((-1.0 if found[1] == "-" else 1.0, found[2], int(found[3])))
        at = found.end()
    return terms
