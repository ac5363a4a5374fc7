# SPDX-License-Identifier: Apache-2.0
"""Keys of a terminal as deflections; a terminal reports presses and repeats, but no releases."""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.sources.human.input_settings import KeyboardSettings

DIRECTIONS = {
    "w": (0, 1.0), "s": (0, -1.0), "a": (1, 1.0), "d": (1, -1.0), "r": (2, 1.0), "f": (2, -1.0),
    "u": (3, 1.0), "o": (3, -1.0), "i": (4, 1.0), "k": (4, -1.0), "j": (5, 1.0), "l": (5, -1.0),
}  # fmt: skip
FASTER, SLOWER, STOP, QUIT = "+", "-", " ", "q"
HELP = (
    "w s: x    a d: y    r f: z    u o, i k, j l: rotate about x, y, z\n"
    "+ -: faster, slower    space: stop    q: quit"
)


class KeyState:
    """Directions held by keys, each for a while after its last key press.

    Args:
        settings: The block `keyboard`.

    Attributes:
        speed: Deflection that a pressed key stands for, as a share of full deflection.
    """

    def __init__(self, settings: KeyboardSettings) -> None:
        self._settings = settings
        self._keys: dict[int, tuple[float, float]] = {}
        self.speed = 0.5

    def press(self, key: str, now: float) -> None:
        """Handle a key press at a time [s]; an unknown key releases all directions."""
        if key in DIRECTIONS:
            direction, sign = DIRECTIONS[key]
            self._keys[direction] = sign, now
        elif key in (FASTER, SLOWER):
            factor = self._settings.step if key == FASTER else 1.0 / self._settings.step
            self.speed = min(1.0, self.speed * factor)
        else:
            self._keys.clear()

    def stick(self, now: float) -> Array:
        """Return the deflections along and about x, y, z at a time [s], shape (6,)."""
        stick = np.zeros(6)
        for direction, (sign, pressed) in self._keys.items():
            if now - pressed <= self._settings.key_hold:
                stick[direction] = sign * self.speed
        return stick
