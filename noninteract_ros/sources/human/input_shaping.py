# SPDX-License-Identifier: Apache-2.0
"""From what a person does with a device to rates and set-points of a subtask.

Velocity, acceleration and jerk are bounded where rates and set-points become references
(`control/desired.py`), from the motion that the subtask has: so taking over, letting go and taking
hold again never jump. What belongs to the person is here: scaling, the dead-man's switch, the
clutch, and the box beyond which nobody can lead.
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
LATENCY = 0.06  # [s] between a place that was heard of and the rate that takes it into account


class DeadMan:
    """Whether something is held; silence lets go, and then it has to be taken hold of anew.

    Args:
        timeout: Silence that lets go [s].
    """

    def __init__(self, timeout: float) -> None:
        self._timeout = timeout
        self._held = self._lapsed = False
        self._heard = -np.inf

    def note(self, now: float, held: bool) -> None:
        """The device says at a time [s] whether it is held."""
        self.held(now)
        self._heard = now
        self._lapsed = self._lapsed and held
        self._held = held and not self._lapsed

    def held(self, now: float) -> bool:
        """Whether it is held at a time [s]."""
        if self._held and now - self._heard > self._timeout:
            self.lapse()
        return self._held

    def lapse(self) -> None:
        """Lets go until it is let go and taken hold of anew."""
        self._held, self._lapsed = False, True


def deflection(value: Array, deadzone: float, exponent: float) -> Array:
    """Deflections within -1 and 1, zero in the dead zone and continuous at its edge."""
    size = np.clip((np.abs(value) - deadzone) / (1.0 - deadzone), 0.0, 1.0)
    return np.sign(value) * size**exponent


class Workspace:
    """The box of plain coordinates that an operator can lead to.

    Args:
        settings: The operator's block.
        subtask: What is led.
        limits: Bounds of its velocity, acceleration and jerk, shape (3, p).
        path: Dotted key of the block, for error messages.

    Raises:
        ScenarioError: The box has another size than the subtask.
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

    def place(self, value: Array) -> Array:
        """The nearest value in the box, shape (size,)."""
        found = value.copy()
        found[self._values] = np.clip(value[self._values], self._lower, self._upper)
        return found

    def rate(self, velocity: Array, now: Reference) -> Array:
        """A velocity that comes to rest within the box, shape (p,).

        From the velocity u, braked with a within the jerk j, rest takes no more way than
        u^2 / (2 a) + u a / (2 j), and what happens before that takes a latency, in which an
        acceleration b that there is goes on; it ends no sooner than after b / j. For a stands
        half of the bound, and the latency counts twice: the motion lags behind this curve.

        Args:
            velocity: What is asked for, shape (p,).
            now: Desired motion as it was heard of.
        """
        found, here = velocity.copy(), now.position[self._values]
        a, j = 0.5 * self._limits[1], self._limits[2]
        c = 0.5 * a / j + 2.0 * self._latency

        def fastest(way: Array, b: Array) -> Array:
            end = a * (np.sqrt(c * c + 2.0 * np.maximum(way, 0.0) / a) - c)
            b = np.maximum(b, 0.0)
            return np.maximum(end - b * self._latency - 0.5 * b * b / j, 0.0)

        growth = now.acceleration[self._rates]
        found[self._rates] = np.clip(
            velocity[self._rates],
            -fastest(here - self._lower, -growth),
            fastest(self._upper - here, growth),
        )
        return found


class OperatorInput:
    """Sticks and poses of a person as rates and set-points of a subtask of one element.

    Args:
        settings: The operator's block.
        subtask: What is led.
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
        """Velocity of the subtask, shape (p,).

        Args:
            stick: Deflections along x, y, z and about them, shape (6,), in world axes.
            now: Desired motion of the subtask.
        """
        velocity = np.empty(self._layout.dim)
        velocity[self._layout.rates] = self._settings.linear_speed * stick[self._places]
        velocity[self._layout.angular] = self._settings.angular_speed * stick[3:]
        return self._workspace.rate(velocity, now)

    @property
    def clutched(self) -> bool:
        """Whether the device has been taken hold of."""
        return self._anchor is not None

    def engage(self, pose: Array, value: Array) -> None:
        """Takes hold: from here on the subtask moves as the device does.

        Args:
            pose: Of the device, position and quaternion in world axes, shape (7,).
            value: Where the subtask is led to now, shape (size,).
        """
        self._anchor = pose, value

    def release(self) -> None:
        """Lets go."""
        self._anchor = None

    def target(self, pose: Array) -> Array:
        """Where the device leads the subtask, shape (size,).

        Raises:
            InputError: Nobody has taken hold.
        """
        if self._anchor is None:
            raise InputError("the clutch is not held")
        start, value = self._anchor
        gap = np.empty(self._layout.dim)
        way = self._settings.linear_scale * (pose[:3] - start[:3])
        gap[self._layout.rates] = way[self._places]
        if self._layout.rotates:
            turn = so3.log(so3.product(pose[3:], so3.inverse(start[3:])))
            gap[self._layout.angular] = self._settings.angular_scale * turn
        return self._workspace.place(self._layout.sum(value, gap))
