# SPDX-License-Identifier: Apache-2.0
"""Mass, damping and workspace boundary of the device, and the operator's delayed correction."""

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


class DeviatingHand(Protocol):
    """Hand whose deviation from the intended motion is known."""

    @property
    def offset(self) -> tuple[Array, Array]:
        """Deviation of the translational coordinates and its rate, shape (p,) each [m; m/s]."""


class DeviceDynamics:
    """Forces on hand and device besides the hand's impedance.

    The hand's impedance pulls hand and device towards the intended motion x_i. The device adds its
    mass m_d and damping b_d. The deviation e from the intended motion obeys

        (m + m_d) e'' + (d + b_d) e' + k e = f - m_d x_i'' - b_d x_i' + f_end - k_r e(t - t_r)

    with the force f of the motors, held over a tick, the boundary force f_end where x_i + e lies
    outside the workspace, and the operator's correction, delayed by t_r. The real part of the
    impedance is d - k_r sin(w t_r) / w >= d - k_r t_r, so the arm is passive wherever
    k_r t_r <= d. Only translational coordinates are affected, rotations are not.

    Args:
        settings: Block `haptic` of the scenario.
        centre: Centre of the workspace, shape (p,) [m].
        indices: Indices of the translational coordinates in a velocity and in a value.
    """

    def __init__(
        self, settings: HapticSettings, centre: Array, indices: tuple[Array, Array]
    ) -> None:
        self._settings, self._centre = settings, centre
        self._rates, self._values = indices
        self._half = 0.5 * np.array(settings.workspace) if settings.workspace else np.inf
        self._delay = round(settings.reaction_delay * settings.update_rate)
        self.reset()

    @classmethod
    def of(cls, settings: HapticSettings, layout: Layout, path: str) -> "DeviceDynamics | None":
        """Create the dynamics of a scenario; None where only the motors act on the hand.

        Raises:
            ScenarioError: The workspace does not have the subtask's size, or a translational key
                is set for a subtask without translations.
        """
        count = layout.rates.size
        for name in ("workspace", "workspace_centre"):
            found = getattr(settings, name)
            if found and len(found) != count:
                raise ScenarioError(
                    join(path, name), list(found), f"{count} numbers, one per coordinate"
                )
        own = [name for name in TRANSLATIONAL if getattr(settings, name)]
        if own and not count:
            found = getattr(settings, own[0])
            raise ScenarioError(join(path, own[0]), found, "0 for a subtask that only rotates")
        if not (own or settings.workspace):
            return None
        centre = np.array(settings.workspace_centre or (0.0,) * count)
        return cls(settings, centre, (layout.rates, layout.values))

    def reset(self) -> None:
        """Discard all past deviations."""
        self._deviations: deque[Array] = deque(maxlen=self._delay + 1)

    def update(self, hand: DeviatingHand) -> None:
        """Store the current deviation; call once per update period."""
        self._deviations.append(hand.offset[0])

    def force(self, motors: Array, intended: Reference, hand: DeviatingHand) -> Array:
        """Return the total force on hand and device, without the hand's impedance [N; N m].

        Args:
            motors: Force of the motors, shape (dim,).
            intended: Intended motion of the hand.
            hand: The hand, for its deviation.

        Returns:
            Force, shape (dim,).
        """
        settings, total = self._settings, motors.copy()
        velocity, acceleration = (
            item[self._rates] for item in (intended.velocity, intended.acceleration)
        )
        offset = intended.position[self._values] + hand.offset[0] - self._centre
        excess = offset - np.clip(offset, -self._half, self._half)
        total[self._rates] -= (
            settings.device_mass * acceleration
            + settings.device_damping * velocity
            + settings.workspace_stiffness * excess
        )
        if len(self._deviations) > self._delay:
            total[self._rates] -= settings.reaction_stiffness * self._deviations[0]
        return total
