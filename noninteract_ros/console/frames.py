# SPDX-License-Identifier: Apache-2.0
"""Pictures as bytes: what the page draws, many times a second.

Little-endian: kind u4 (1: meshes, 2: picture). A picture goes on with the number of poses u4, the
time f8, and x, y, z, quaternion x, y, z, w f4 of each pose, in the order that the greeting gives.
"""

import struct

import numpy as np

from noninteract_ros.arrays import Array

MESHES, PICTURE = 1, 2


def picture(time: float, poses: list[Array]) -> bytes:
    """A picture.

    Args:
        time: Time of the team's state [s].
        poses: Arrays of poses, shape (..., 7) each.
    """
    numbers = np.concatenate([np.asarray(part).ravel() for part in poses])
    head = struct.pack("<IId", PICTURE, len(numbers) // 7, time)
    return head + numbers.astype("<f4").tobytes()


def meshes(data: bytes) -> bytes:
    """All meshes, as `shapes.mesh_bytes` makes them."""
    return struct.pack("<I", MESHES) + data
