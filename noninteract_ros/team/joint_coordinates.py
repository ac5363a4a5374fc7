# SPDX-License-Identifier: Apache-2.0
"""Conversion between joint positions, as in messages, and Pinocchio configurations."""

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from noninteract_ros.arrays import Array


class JointCoordinates:
    """Conversion of joint positions, shape (n,), to a configuration, shape (nq,), and back.

    The configuration of a continuous joint is the cosine and sine of its angle. Its position is
    the angle: any value as input, a value within (-pi, pi] as output. All other joints have the
    same number in both. Without continuous joints, arrays are returned unchanged.

    Args:
        model: Model whose joints have one degree of freedom each.
    """

    def __init__(self, model: pin.Model) -> None:
        joints = list(model.joints)[1:]
        self._model = model
        self._euclidean = all(joint.nq == 1 for joint in joints)
        self._scalar = _indices([joint for joint in joints if joint.nq == 1])
        self._continuous = _indices([joint for joint in joints if joint.nq == 2])

    def configuration(self, positions: Array) -> Array:
        """Return the configuration, shape (nq,), of joint positions, shape (n,)."""
        if self._euclidean:
            return positions
        q = np.empty(self._model.nq)
        in_q, in_v = self._scalar
        q[in_q] = positions[in_v]
        in_q, in_v = self._continuous
        q[in_q] = np.cos(positions[in_v])
        q[in_q + 1] = np.sin(positions[in_v])
        return q

    def positions(self, q: Array) -> Array:
        """Return the joint positions, shape (n,), of a configuration, shape (nq,)."""
        if self._euclidean:
            return q
        positions = np.empty(self._model.nv)
        in_q, in_v = self._scalar
        positions[in_v] = q[in_q]
        in_q, in_v = self._continuous
        angles = np.arctan2(q[in_q + 1], q[in_q])
        positions[in_v] = np.where(angles == -np.pi, np.pi, angles)
        return positions

    def difference(self, start: Array, end: Array) -> Array:
        """Return the shortest tangent vector from one configuration to another, shape (n,)."""
        return end - start if self._euclidean else pin.difference(self._model, start, end)


def _indices(joints: list[pin.JointModel]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the indices of joints in the configuration and in the velocity."""
    in_q = np.array([joint.idx_q for joint in joints], dtype=np.intp)
    return in_q, np.array([joint.idx_v for joint in joints], dtype=np.intp)
