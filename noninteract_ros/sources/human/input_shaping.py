# SPDX-License-Identifier: Apache-2.0
"""Conversion of an operator's device inputs to velocities and set-points of a subtask.

This module has scaling, dead zone, dead-man's switch, clutch and workspace, and no input shaping
in the sense of vibration suppression. Velocity, acceleration and jerk are bounded later, in the
controller (`control/references/desired_motion.py`), which starts from the subtask's current
motion, so that take-over, release and re-engagement never jump.
"""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import InputError, ScenarioError
from noninteract_ros.schema import join
from noninteract_ros.sources.human.input_settings import OperatorSettings
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.reference import Reference
from noninteract_ros.subtasks.subtask import Subtask

AXES = ("x", "y", "z")
LATENCY = 0.06  # Time [s] from the stamp of a position to the effect of a velocity based on it.


class DeadManSwitch:
    """Dead-man's switch with a timeout.

    After a timeout the switch has to be released and held again.

    Args:
        timeout: Time without updates after which the switch is released [s].
    """

    def __init__(self, timeout: float) -> None:
        self._timeout = timeout
        self._held = self._locked = False
        self._updated = -np.inf

    def update(self, now: float, held: bool) -> None:
        """Update with the device's state at a time [s]."""
        self.is_held(now)
        self._updated = now
        self._locked = self._locked and held
        self._held = held and not self._locked

    def is_held(self, now: float) -> bool:
        """Return True if the switch is held at a time [s]."""
        if self._held and now - self._updated > self._timeout:
            self.release()
        return self._held

    def release(self) -> None:
        """Release the switch until the device has released it and holds it again."""
        self._held, self._locked = False, True


def deflection(value: Array, deadzone: float, exponent: float) -> Array:
    """Shape deflections to [-1, 1], zero in the dead zone and continuous at its edge."""
    size = np.clip((np.abs(value) - deadzone) / (1.0 - deadzone), 0.0, 1.0)
    return np.sign(value) * size**exponent


class Workspace:
    """Box of translational coordinates that the operator can command.

    Args:
        settings: Block `operator`.
        subtask: Commanded subtask.
        limits: Bounds of its velocity, acceleration and jerk, shape (3, p).
        path: Dotted key of the block, for error messages.

    Raises:
        ScenarioError: The box does not have the subtask's number of coordinates.
    """

    def __init__(
        self, settings: OperatorSettings, subtask: Subtask, limits: Array, path: str = "operator"
    ) -> None:
        layout = subtask.layout
        count = layout.rates.size
        for name in ("workspace", "workspace_centre"):
            found = getattr(settings, name)
            if found and len(found) != count:
                allowed = f"{count} numbers, one per coordinate"
                raise ScenarioError(join(path, name), list(found), allowed)
        centre = np.array(settings.workspace_centre or (0.0,) * count)
        half = 0.5 * np.array(settings.workspace) if settings.workspace else np.inf
        self._lower, self._upper = centre - half, centre + half
        self._values, self._rates = layout.values, layout.rates
        self._limits = limits[:, layout.rates]
        self._latency = LATENCY + 1.0 / settings.update_rate

    def clamp(self, value: Array) -> Array:
        """Return the nearest value in the box, shape (size,)."""
        found = value.copy()
        found[self._values] = np.clip(value[self._values], self._lower, self._upper)
        return found

    def limit_velocity(self, velocity: Array, now: Reference) -> Array:
        """Limit a velocity so that the motion comes to rest within the box, shape (p,).

        Braking from the velocity u with the acceleration a and the jerk j takes a distance of at
        most u^2 / (2 a) + u a / (2 j). Before that a latency passes, during which a present
        acceleration b continues; it ends no sooner than after b / j. Half of the acceleration
        bound is used for a, and the latency counts twice, since the motion lags behind this curve.

        Args:
            velocity: Commanded velocity, shape (p,).
            now: Desired motion as last received.
        """
        found, here = velocity.copy(), now.position[self._values]
        a, j = 0.5 * self._limits[1], self._limits[2]
        c = 0.5 * a / j + 2.0 * self._latency

        def fastest(distance: Array, b: Array) -> Array:
            end = a * (np.sqrt(c * c + 2.0 * np.maximum(distance, 0.0) / a) - c)
            b = np.maximum(b, 0.0)
            return np.maximum(end - b * self._latency - 0.5 * b * b / j, 0.0)

        acceleration = now.acceleration[self._rates]
        found[self._rates] = np.clip(
            velocity[self._rates],
            -fastest(here - self._lower, -acceleration),
            fastest(self._upper - here, acceleration),
        )
        return found


class OperatorInput:
    """Velocities and set-points of a one-element subtask from an operator's sticks and poses.

    Args:
        settings: Block `operator`.
        subtask: Commanded subtask.
        limits: Bounds of its velocity, acceleration and jerk, shape (3, p).
        path: Dotted key of the block, for error messages.

    Raises:
        ScenarioError: The subtask has several elements, or the workspace does not fit it.
    """

    def __init__(
        self, settings: OperatorSettings, subtask: Subtask, limits: Array, path: str = "operator"
    ) -> None:
        if len(subtask.elements) != 1:
            allowed = f"a subtask of one element; it has {len(subtask.elements)}"
            raise ScenarioError(join(path, "subtask"), repr(settings.subtask), allowed)
        self._settings, self._layout = settings, subtask.layout
        self._places = [AXES.index(axis) for axis in subtask.axes]
        self._workspace = Workspace(settings, subtask, limits, path)
        self._anchor: tuple[Array, Array] | None = None

    def rate(self, stick: Array, now: Reference) -> Array:
        """Return the velocity of the subtask, shape (p,).

        Args:
            stick: Deflections along and about x, y, z, shape (6,), in world axes.
            now: Desired motion of the subtask.
        """
        velocity = np.empty(self._layout.dim)
        velocity[self._layout.rates] = self._settings.linear_speed * stick[self._places]
        velocity[self._layout.angular] = self._settings.angular_speed * stick[3:]
        return self._workspace.limit_velocity(velocity, now)

    @property
    def clutched(self) -> bool:
        """True while the clutch is engaged."""
        return self._anchor is not None

    def engage(self, pose: Array, value: Array) -> None:
        """Engage the clutch: couple the subtask's motion to the device's from here on.

        Args:
            pose: Pose of the device, position and quaternion in world axes, shape (7,).
            value: Desired value of the subtask now, shape (size,).
        """
        self._anchor = pose, value

    def release(self) -> None:
        """Release the clutch."""
        self._anchor = None

    def target(self, pose: Array) -> Array:
        """Return the set-point of the subtask for a pose of the device, shape (size,).

        Raises:
            InputError: The clutch is not engaged.
        """
        if self._anchor is None:
            raise InputError("the clutch is not engaged")
        start, value = self._anchor
        gap = np.empty(self._layout.dim)
        displacement = self._settings.linear_scale * (pose[:3] - start[:3])
        gap[self._layout.rates] = displacement[self._places]
        if self._layout.rotates:
            rotation = so3.log(so3.product(pose[3:], so3.inverse(start[3:])))
            gap[self._layout.angular] = self._settings.angular_scale * rotation
        return self._workspace.clamp(self._layout.sum(value, gap))
