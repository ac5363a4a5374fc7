# SPDX-License-Identifier: Apache-2.0
"""What a team and the bodies around it look like, as the page is told once."""

import struct
from typing import Any

import numpy as np

from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.shapes import Shape, shapes_of
from noninteract_ros.simulation.plant import Plant

SMALLEST = 0.6  # [m] radius of a team, so that point masses that stand together can be seen


def team_shapes(scenario: Scenario, plant: Plant) -> list[Shape]:
    """Convex bodies on the joints of a plant, in as few triangles as they have."""
    team = plant.team
    tools = team.state(team.q0, np.zeros(team.n)).tool_positions
    reach = float(np.linalg.norm(tools - tools.mean(axis=0), axis=1).max())
    return shapes_of(scenario, plant, max(SMALLEST, reach), np.inf)


def described(shapes: list[Shape]) -> list[dict[str, Any]]:
    """Joint and robot of each body; -1 for what is no robot's."""
    return [{"joint": int(shape.joint), "robot": shape.owner} for shape in shapes]


def mesh_bytes(shapes: list[Shape]) -> bytes:
    """All bodies: number of corners u4, corners f4 (3 each), normals i1 (3 each), padded to four.

    Little-endian; three corners are a triangle; normals are counted in 127ths.
    """
    parts: list[bytes] = []
    for shape in shapes:
        corners = shape.hull.corners.astype("<f4").tobytes()
        normals = np.rint(127.0 * shape.hull.normals).astype("i1").tobytes()
        parts += [struct.pack("<I", len(corners) // 12), corners, normals]
        parts.append(bytes(-len(normals) % 4))
    return b"".join(parts)
