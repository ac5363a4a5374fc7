# SPDX-License-Identifier: Apache-2.0
"""One number per joint, as people and messages have it, and Pinocchio's configuration."""

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from noninteract_ros.arrays import Array


class JointCoordinates:
    """Converts joint positions, shape (n,), to a configuration, shape (nq,), and back.

    A continuous joint turns without end: its position is an angle, any one in and one within
    (-pi, pi] out, while its configuration is the angle's cosine and sine. All other joints have
    the same number in both; of a model without continuous joints, arrays pass as they are.

    Args:
        model: Joints of one degree of freedom each.
    """

    def __init__(self, model: pin.Model) -> None:
        joints = list(model.joints)[1:]
        self._model = model
        self._straight = all(joint.nq == 1 for joint in joints)
        self._plain = _indices([joint for joint in joints if joint.nq == 1])
        self._turning = _indices([joint for joint in joints if joint.nq == 2])

    def configuration(self, positions: Array) -> Array:
        """Configuration of joint positions."""
        if self._straight:
            return positions
        q = np.empty(self._model.nq)
        places, joints = self._plain
        q[places] = positions[joints]
        places, joints = self._turning
        q[places] = np.cos(positions[joints])
        q[places + 1] = np.sin(positions[joints])
        return q

    def positions(self, q: Array) -> Array:
        """Joint positions of a configuration."""
        if self._straight:
            return q
        positions = np.empty(self._model.nv)
        places, joints = self._plain
        positions[joints] = q[places]
        places, joints = self._turning
        angles = np.arctan2(q[places + 1], q[places])
        positions[joints] = np.where(angles == -np.pi, np.pi, angles)
        return positions

    def difference(self, start: Array, end: Array) -> Array:
        """Shortest way from one configuration to another, shape (n,)."""
        return end - start if self._straight else pin.difference(self._model, start, end)


def _indices(joints: list[pin.JointModel]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Where joints stand in the configuration and in the velocity."""
    places = np.array([joint.idx_q for joint in joints], dtype=np.intp)
    return places, np.array([joint.idx_v for joint in joints], dtype=np.intp)
