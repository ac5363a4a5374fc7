# SPDX-License-Identifier: Apache-2.0
"""What acts on a hand that holds a device, besides its own grip and the device's motors."""

from collections import deque
from typing import Protocol

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import join
from noninteract_ros.sources.human.haptic_settings import HapticSettings
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference

TRANSLATIONAL = ("device_mass", "device_damping", "reaction_stiffness")


class Offset(Protocol):
    """A hand, of which the deviation of the plain coordinates is known."""

    @property
    def offset(self) -> tuple[Array, Array]:
        """Deviation and its rate, shape (dim,) each [m; m/s]."""


class HeldDevice:
    """The device's own dynamics, the ends of its workspace, and an operator who notices late.

    The grip pulls hand and device towards the intended motion, but the device's mass m_d and
    damping b_d are moved by nothing else: at the deviation e from the intended motion x_i

        (m + m_d) e'' + (d + b_d) e' + k e = f - m_d x_i'' - b_d x_i' + f_end - k_r e(t - t_r)

    with the force f of the motors, held over a tick, f_end where x_i + e lies outside the
    workspace, and the correction of an operator who sees the deviation t_r later. Because the
    real part of its impedance is d - k_r sin(w t_r) / w >= d - k_r t_r, the arm is passive
    wherever k_r t_r <= d. All this concerns the plain coordinates, not rotations.

    Args:
        settings: The block of the device.
        centre: Centre of the workspace, shape (p,) [m].
        places: Where the plain coordinates are in a velocity and in a value.
    """

    def __init__(
        self, settings: HapticSettings, centre: Array, places: tuple[Array, Array]
    ) -> None:
        self._settings, self._centre = settings, centre
        self._rates, self._values = places
        self._half = 0.5 * np.array(settings.workspace) if settings.workspace else np.inf
        self._late = round(settings.reaction_delay * settings.update_rate)
        self.reset()

    @classmethod
    def of(cls, settings: HapticSettings, layout: Layout, path: str) -> "HeldDevice | None":
        """The device of a scenario; None where nothing but its motors acts on the hand.

        Raises:
            ScenarioError: The workspace has another size than the subtask, or a key for
                translations is given where there are none.
        """
        count = layout.rates.size
        for name in ("workspace", "workspace_centre"):
            found = getattr(settings, name)
            if found and len(found) != count:
                raise ScenarioError(
                    join(path, name), list(found), f"{count} numbers, one a coordinate"
                )
        own = [name for name in TRANSLATIONAL if getattr(settings, name)]
        if own and not count:
            found = getattr(settings, own[0])
            raise ScenarioError(join(path, own[0]), found, "0 for a subtask that only turns")
        if not (own or settings.workspace):
            return None
        centre = np.array(settings.workspace_centre or (0.0,) * count)
        return cls(settings, centre, (layout.rates, layout.values))

    def reset(self) -> None:
        """The operator has seen no deviation."""
        self._seen: deque[Array] = deque(maxlen=self._late + 1)

    def notice(self, hand: Offset) -> None:
        """The operator looks; once per update period."""
        self._seen.append(hand.offset[0])

    def force(self, motors: Array, intended: Reference, hand: Offset) -> Array:
        """All that acts on hand and device besides the grip [N; N m], shape (dim,).

        Args:
            motors: What the motors do, shape (dim,).
            intended: The motion that the hand intends.
            hand: The hand, for its deviation.
        """
        settings, total = self._settings, motors.copy()
        velocity, acceleration = (
            item[self._rates] for item in (intended.velocity, intended.acceleration)
        )
        away = intended.position[self._values] + hand.offset[0] - self._centre
        outside = away - np.clip(away, -self._half, self._half)
        total[self._rates] -= (
            settings.device_mass * acceleration
            + settings.device_damping * velocity
            + settings.workspace_stiffness * outside
        )
        if len(self._seen) > self._late:
            total[self._rates] -= settings.reaction_stiffness * self._seen[0]
        return total
