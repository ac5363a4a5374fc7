# SPDX-License-Identifier: Apache-2.0
"""Pose from a list of numbers, as in scenario files."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from noninteract_ros.errors import ScenarioError

UNIT_TOLERANCE = 1e-3  # of a quaternion's length, for quaternions rounded by hand


def pose_from_list(key: str, numbers: Sequence[float]) -> pin.SE3:
    """Return the pose of position [m] and quaternion: x, y, z, qx, qy, qz, qw.

    Args:
        key: Full key, for error messages.
        numbers: The seven numbers.

    Raises:
        ScenarioError: The count is not seven, or the quaternion is not of unit length.
    """
    if len(numbers) != 7:
        raise ScenarioError(key, list(numbers), "7 numbers: x y z qx qy qz qw")
    rotation = np.array(numbers[3:])
    length = np.linalg.norm(rotation)
    if abs(length - 1.0) > UNIT_TOLERANCE:
        found = f"{list(numbers)} with a quaternion of length {length:.4g}"
        raise ScenarioError(key, found, "x y z qx qy qz qw with a quaternion of length 1")
    return pin.XYZQUATToSE3(np.array([*numbers[:3], *(rotation / length)]))
