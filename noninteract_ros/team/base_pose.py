# SPDX-License-Identifier: Apache-2.0
"""Where a robot stands."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from noninteract_ros.errors import ScenarioError

UNIT_TOLERANCE = 1e-3  # How far a quaternion that people have rounded may be from unit length.


def base_pose(key: str, numbers: Sequence[float]) -> pin.SE3:
    """A pose from position [m] and quaternion: x, y, z, qx, qy, qz, qw.

    Raises:
        ScenarioError: There are not seven numbers, or the last four are no unit quaternion.
    """
    if len(numbers) != 7:
        raise ScenarioError(key, list(numbers), "7 numbers: x y z qx qy qz qw")
    rotation = np.array(numbers[3:])
    length = np.linalg.norm(rotation)
    if abs(length - 1.0) > UNIT_TOLERANCE:
        found = f"{list(numbers)} with a quaternion of length {length:.4g}"
        raise ScenarioError(key, found, "x y z qx qy qz qw with a quaternion of length 1")
    return pin.XYZQUATToSE3(np.array([*numbers[:3], *(rotation / length)]))
