# SPDX-License-Identifier: Apache-2.0
"""Desired motion of one subtask: continuous across changes of source, at rest without one.

Set-points, rates, take-overs and stops are shaped by ruckig within bounds of velocity,
acceleration and jerk. A full reference passes unchanged once it has been taken over. Rotations are
shaped as rotation vectors relative to the goal, which gives motions on SO(3) with exact
derivatives; their angular velocity never exceeds the rate of the rotation vector.
"""

from dataclasses import replace

import numpy as np
from ruckig import ControlInterface, InputParameter, OutputParameter, Result, Ruckig, RuckigError

from noninteract_ros.arrays import Array
from noninteract_ros.control.references.inputs import MotionInput, Rate, Target
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference

HORIZON = 1000.0  # [s] largest duration of a planned motion


class MotionShaper:
    """Motion of scalars towards a state, one step at a time, within limits.

    An acceleration beyond the limit is reduced with bounded jerk. If no motion to a set-point can
    be planned, the motion decelerates; if that cannot be planned either, it stops.

    Args:
        limits: Bounds of velocity, acceleration and jerk, shape (3, p).
    """

    def __init__(self, limits: Array) -> None:
        dim = limits.shape[1]
        self._generator = Ruckig(dim, 1.0)
        self._input, self._output = InputParameter(dim), OutputParameter(dim)
        self._input.max_velocity, self._input.max_acceleration, self._input.max_jerk = limits
        self._max_velocity = limits[0]

    def towards(self, start: Reference, target: Target, step: float) -> tuple[Reference, bool]:
        """Return the state `step` [s] later towards a set-point, and True if it is reached."""
        self._input.control_interface = ControlInterface.Position
        reach = HORIZON * self._max_velocity
        away = np.clip(target.position - start.position, -reach, reach)
        near = np.abs(away) < reach
        self._input.target_position = np.where(near, target.position, start.position + away)
        planned = self._advance(start, target.velocity, step)
        return planned or self.at_rate(start, np.zeros_like(start.velocity), step)

    def at_rate(self, start: Reference, rate: Array, step: float) -> tuple[Reference, bool]:
        """Return the state `step` [s] later towards a velocity, and True if it is reached."""
        self._input.control_interface = ControlInterface.Velocity
        return self._advance(start, rate, step) or (Reference.at_rest(start.position), False)

    def _advance(
        self, start: Reference, speed: Array, step: float
    ) -> tuple[Reference, bool] | None:
        """Advance ruckig by one step; return None if it fails."""
        self._generator.delta_time = step
        self._input.current_position = start.position
        self._input.current_velocity = start.velocity
        self._input.current_acceleration = start.acceleration
        self._input.target_velocity = np.clip(speed, -self._max_velocity, self._max_velocity)
        try:
            result = self._generator.update(self._input, self._output)
        except (RuckigError, ValueError):  # ValueError: unnamed results of ruckig.
            result = Result.Error
        if result not in (Result.Working, Result.Finished):
            return None
        reached = Reference(
            np.array(self._output.new_position),
            np.array(self._output.new_velocity),
            np.array(self._output.new_acceleration),
        )
        return reached, result == Result.Finished


class AccelerationCarryOver:
    """Acceleration that a motion keeps after its source has left it.

    To reduce an acceleration a with the jerk j increases the velocity by a^2 / (2 j). An
    acceleration up to twice that of motions within the limits, as in a difference of two of them,
    is always reduced with bounded jerk; a larger one only while the velocity stays within its
    limit. The excess is cut at once: there, the limits of jerk and velocity contradict each other,
    and the motion would deviate far.

    Args:
        limits: Bounds of velocity, acceleration and jerk, shape (3, p).
    """

    def __init__(self, limits: Array) -> None:
        self._max_velocity, max_acceleration, self._max_jerk = limits
        # Largest acceleration in use from rest to full velocity, whatever the limit.
        needed = np.minimum(max_acceleration, np.sqrt(self._max_jerk * self._max_velocity))
        self._twice = np.maximum(max_acceleration, 2.0 * needed)

    def of(self, left: Reference, base: Reference | None = None) -> Reference:
        """Return a motion with the acceleration that it keeps, relative to `base` if given."""
        velocity, acceleration = left.velocity, left.acceleration
        if base is not None:
            velocity, acceleration = velocity - base.velocity, acceleration - base.acceleration
        ahead = self._max_velocity - np.sign(acceleration) * velocity
        room = np.clip(ahead, 0.0, 2.0 * self._max_velocity)
        bound = np.maximum(self._twice, np.sqrt(2.0 * self._max_jerk * room))
        beyond = acceleration - np.clip(acceleration, -bound, bound)
        return replace(left, acceleration=left.acceleration - beyond) if beyond.any() else left


class DesiredMotion:
    """Desired motion of a subtask.

    Args:
        limits: Bounds of velocity, acceleration and jerk, shape (3, p).
        direct: True to take over a full reference at once, with a jump; False to approach it from
            the current desired motion.
        layout: Layout of the subtask's values; scalars if None.
    """

    def __init__(self, limits: Array, direct: bool, layout: Layout | None = None) -> None:
        layout = layout or Layout.scalars(limits.shape[1])
        self._limits, self._direct, self._layout = limits, direct, layout
        self._shaper, self._carry_over = MotionShaper(limits), AccelerationCarryOver(limits)
        self._zero = Target(np.zeros(layout.dim), np.zeros(layout.dim))
        self.hold_at(layout.identity)

    @property
    def now(self) -> Reference:
        """Desired position, velocity and acceleration at the last tick."""
        return self._now

    def hold_at(self, x: Array) -> None:
        """Reset to rest at x, shape (size,)."""
        self._now = Reference.at_rest(x, self._layout)
        self._followed: Reference | None = None
        self._gap: Reference | None = None
        self._chart: tuple[Array, Reference] | None = None

    def advance(self, motion: MotionInput | None, step: float) -> Reference:
        """Return the desired motion one tick later.

        Args:
            motion: Input of the source in authority (a full reference as of this tick), or None.
            step: Time since the last tick [s].
        """
        if isinstance(motion, Reference):
            self._chart = None
            self._now = self._follow(motion, step)
            self._followed = motion
            return self._now
        if self._followed is not None:
            self._now = self._carry_over.of(self._now)
        self._followed = self._gap = None
        if step > 0.0:
            self._now = self._shape(motion, step)
        return self._now

    def _shape(self, motion: Target | Rate | None, step: float) -> Reference:
        if isinstance(motion, Target):
            shaped, done = self._towards(motion, step)
            if not done or motion.velocity.any():
                return shaped
            self._chart = None
            return Reference.at_rest(motion.position, self._layout)
        self._chart = None
        if isinstance(motion, Rate):
            return self._at_rate(motion.velocity, step)[0]
        if not (self._now.velocity.any() or self._now.acceleration.any()):
            return self._now
        shaped, done = self._at_rate(self._zero.velocity, step)
        return Reference.at_rest(shaped.position, self._layout) if done else shaped

    def _towards(self, target: Target, step: float) -> tuple[Reference, bool]:
        """Shape the motion in local coordinates about the rotations of the target.

        The target's rotations are zero in them. The coordinates are kept between ticks: ruckig
        fails occasionally if a state that it returned comes back with different rounding.
        """
        layout = self._layout
        origin = Reference.at_rest(layout.origin(target.position), layout)
        goal = Target(layout.difference(target.position, origin.position), target.velocity)
        if self._chart is not None and np.array_equal(self._chart[0], origin.position):
            start = self._chart[1]
        else:
            start = self._now.minus(origin, layout)
        shaped, done = self._shaper.towards(start, goal, step)
        self._chart = (origin.position, shaped)
        return origin.plus(shaped, layout), done

    def _at_rate(self, rate: Array, step: float) -> tuple[Reference, bool]:
        """Shape the motion in local coordinates about the current rotations."""
        layout = self._layout
        origin = Reference.at_rest(layout.origin(self._now.position), layout)
        shaped, done = self._shaper.at_rate(self._now.minus(origin, layout), rate, step)
        return origin.plus(shaped, layout), done

    def _follow(self, motion: Reference, step: float) -> Reference:
        """Return the reference plus a gap that closes smoothly; no gap in a direct take-over."""
        if self._direct:
            return motion
        if self._jumps(motion, step):
            before = motion.extrapolate(-step, self._layout)
            self._gap = self._carry_over.of(self._now, before).minus(before, self._layout)
        if self._gap is not None and step > 0.0:
            self._gap, closed = self._shaper.towards(self._gap, self._zero, step)
            if closed:
                self._gap = None
        return motion if self._gap is None else motion.plus(self._gap, self._layout)

    def _jumps(self, motion: Reference, step: float) -> bool:
        """Return True if a reference is new or deviates from its own path beyond the limits."""
        if self._followed is None:
            return True
        away, velocity = motion.deviation(self._followed, step, self._layout)
        max_velocity, max_acceleration, _ = self._limits
        return bool(
            (np.abs(away) > max_velocity * step).any()
            or (np.abs(velocity) > max_acceleration * step).any()
        )
