# SPDX-License-Identifier: Apache-2.0
"""Binary messages to pages: meshes once, poses at the frame rate.

All numbers are little-endian. A message begins with its kind u4 (1: meshes, 2: poses).

- Poses: number of poses u4, time f8, then x, y, z, quaternion x, y, z, w f4 of each pose, in the
  order of the greeting.
- Meshes: for each one the number of triangles u4, corners f4 (9 per triangle) and normals i1
  (9 per triangle, unit 1/127), padded to a multiple of four bytes.
"""

import struct
from collections.abc import Iterable

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.scenario.shapes import Shape

MESHES, POSES = 1, 2


def encode_poses(time: float, poses: list[Array]) -> bytes:
    """Encode one frame.

    Args:
        time: Time of the team's state [s].
        poses: Arrays of poses, shape (..., 7) each.
    """
    numbers = np.concatenate([np.asarray(part).ravel() for part in poses])
    head = struct.pack("<IId", POSES, len(numbers) // 7, time)
    return head + numbers.astype("<f4").tobytes()


def encode_meshes(shapes: Iterable[Shape]) -> bytes:
    """Encode the meshes of all shapes."""
    parts = [struct.pack("<I", MESHES)]
    for shape in shapes:
        corners = shape.hull.corners.astype("<f4").tobytes()
        normals = np.rint(127.0 * shape.hull.normals).astype("i1").tobytes()
        parts += [struct.pack("<I", len(corners) // 12), corners, normals]
        parts.append(bytes(-len(normals) % 4))
    return b"".join(parts)
