# SPDX-License-Identifier: Apache-2.0
"""Passive couplings between frames of a plant: springs, dampers and one-sided contacts."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pinocchio as pin

from noninteract_ros.arrays import Array


@dataclass(frozen=True, slots=True)
class FrameMotion:
    """Where a frame is and how it moves, in world axes.

    Attributes:
        position: Origin, shape (3,) [m].
        rotation: Orientation, shape (3, 3).
        velocity: Velocity of the origin, shape (3,) [m/s].
        angular_velocity: Shape (3,) [rad/s].
    """

    position: Array
    rotation: Array
    velocity: Array
    angular_velocity: Array


@dataclass(frozen=True, slots=True)
class Effect:
    """What a coupling does at one instant.

    Attributes:
        wrenches: Wrench on each of the coupling's frames, at its origin, world axes, shape (6,)
            each [N, N m].
        potential: Energy that it stores [J].
        dissipated: Power that it turns to heat, never negative [W].
    """

    wrenches: tuple[Array, ...]
    potential: float
    dissipated: float


class Coupling(Protocol):
    """A passive thing between frames of a plant."""

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of its frames."""

    def effect(self, motions: tuple[FrameMotion, ...]) -> Effect:
        """Wrenches, energy and loss for the motion of its frames, in their order."""


@dataclass(frozen=True, slots=True)
class Grip:
    """Springs and dampers that hold two frames together, in translation and rotation.

    The translational force acts on both origins in opposite directions; the rotational torque is
    the gradient of c |log(R_2 R_1')|^2 / 2.

    Attributes:
        frames: Names of the two frames.
        stiffness: Translational stiffness [N/m].
        damping: Translational damping [N s/m].
        rotational_stiffness: c [N m/rad].
        rotational_damping: Rotational damping [N m s/rad].
    """

    frames: tuple[str, ...]
    stiffness: float
    damping: float
    rotational_stiffness: float = 0.0
    rotational_damping: float = 0.0

    def effect(self, motions: tuple[FrameMotion, ...]) -> Effect:
        """Wrench on the first frame, its opposite on the second."""
        first, second = motions
        stretch = second.position - first.position
        stretching = second.velocity - first.velocity
        force = self.stiffness * stretch + self.damping * stretching
        torque = np.zeros(3)
        potential = 0.5 * self.stiffness * float(stretch @ stretch)
        dissipated = self.damping * float(stretching @ stretching)
        if self.rotational_stiffness or self.rotational_damping:
            twist = pin.log3(second.rotation @ first.rotation.T)
            twisting = second.angular_velocity - first.angular_velocity
            torque = self.rotational_stiffness * twist + self.rotational_damping * twisting
            potential += 0.5 * self.rotational_stiffness * float(twist @ twist)
            dissipated += self.rotational_damping * float(twisting @ twisting)
        wrench = np.concatenate([force, torque])
        return Effect((wrench, -wrench), potential, dissipated)


@dataclass(frozen=True, slots=True)
class WallContact:
    """A flat wall that pushes a point back and never pulls (Hunt and Crossley's force law).

    Force along the normal: max(0, k d (1 + c d_rate)) with the depth d; it is continuous when
    contact begins and ends.

    Attributes:
        frames: Name of the frame whose origin touches.
        point: A point of the wall, shape (3,) [m].
        normal: Unit normal, away from the wall, shape (3,).
        stiffness: k [N/m].
        damping: c [s/m].
    """

    frames: tuple[str, ...]
    point: Array
    normal: Array
    stiffness: float
    damping: float

    def effect(self, motions: tuple[FrameMotion, ...]) -> Effect:
        """Push on the point, where it is in the wall."""
        (motion,) = motions
        depth = -float(self.normal @ (motion.position - self.point))
        if depth <= 0.0:
            return Effect((np.zeros(6),), 0.0, 0.0)
        sinking = -float(self.normal @ motion.velocity)
        elastic = self.stiffness * depth
        force = max(0.0, elastic * (1.0 + self.damping * sinking))
        wrench = np.concatenate([force * self.normal, np.zeros(3)])
        return Effect((wrench,), 0.5 * elastic * depth, (force - elastic) * sinking)
