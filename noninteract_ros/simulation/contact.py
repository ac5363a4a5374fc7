# SPDX-License-Identifier: Apache-2.0
"""Passive couplings between frames of a plant: springs, dampers and one-sided contacts."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pinocchio as pin

from noninteract_ros.arrays import Array


@dataclass(frozen=True, slots=True)
class FrameMotion:
    """Pose and velocity of a frame, in world axes.

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
    """Wrenches, stored energy and dissipation of a coupling at one instant.

    Attributes:
        wrenches: Wrench on each of the coupling's frames, at its origin, world axes, shape (6,)
            each [N, N m].
        potential: Stored energy [J].
        dissipated: Dissipated power, never negative [W].
    """

    wrenches: tuple[Array, ...]
    potential: float
    dissipated: float


class Coupling(Protocol):
    """A passive element between frames of a plant."""

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of the frames."""

    def effect(self, motions: tuple[FrameMotion, ...]) -> Effect:
        """Compute wrenches, energy and dissipation from the motions of the frames."""


@dataclass(frozen=True, slots=True)
class Grip:
    """Compliant grip: springs and dampers between two frames, in translation and rotation.

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
        """Compute the wrench on the first frame and its opposite on the second."""
        first, second = motions
        extension = second.position - first.position
        extension_rate = second.velocity - first.velocity
        force = self.stiffness * extension + self.damping * extension_rate
        torque = np.zeros(3)
        potential = 0.5 * self.stiffness * float(extension @ extension)
        dissipated = self.damping * float(extension_rate @ extension_rate)
        if self.rotational_stiffness or self.rotational_damping:
            rotation = pin.log3(second.rotation @ first.rotation.T)
            rotation_rate = second.angular_velocity - first.angular_velocity
            torque = self.rotational_stiffness * rotation + self.rotational_damping * rotation_rate
            potential += 0.5 * self.rotational_stiffness * float(rotation @ rotation)
            dissipated += self.rotational_damping * float(rotation_rate @ rotation_rate)
        wrench = np.concatenate([force, torque])
        return Effect((wrench, -wrench), potential, dissipated)


@dataclass(frozen=True, slots=True)
class WallContact:
    """Unilateral contact of a point with a flat wall (Hunt and Crossley's force law).

    The force along the normal is max(0, k d (1 + c d_rate)) with the penetration depth d. It is
    continuous at the start and end of contact.

    Attributes:
        frames: Name of the frame whose origin is in contact.
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
        """Compute the contact force; zero where the point is outside the wall."""
        (motion,) = motions
        depth = -float(self.normal @ (motion.position - self.point))
        if depth <= 0.0:
            return Effect((np.zeros(6),), 0.0, 0.0)
        depth_rate = -float(self.normal @ motion.velocity)
        elastic = self.stiffness * depth
        force = max(0.0, elastic * (1.0 + self.damping * depth_rate))
        wrench = np.concatenate([force * self.normal, np.zeros(3)])
        return Effect((wrench,), 0.5 * elastic * depth, (force - elastic) * depth_rate)
