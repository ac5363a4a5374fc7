# SPDX-License-Identifier: Apache-2.0
"""Generated spatial arms: six or seven revolute joints, thick links, different masses."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from noninteract_ros.team.robot import Robot
from noninteract_ros.team.team import Team, TeamState

JOINTS = {"x": pin.JointModelRX, "y": pin.JointModelRY, "z": pin.JointModelRZ}
OFFSETS = ((0.0, 0.0, 0.3), (0.05, 0.0, 0.25), (0.0, 0.04, 0.2), (-0.06, 0.0, 0.2))
START = (0.3, -0.7, 0.4, 1.2, -0.5, 0.8, 0.2)


def spatial_arm(
    name: str,
    scale: float = 1.0,
    base: Sequence[float] = (0.0, 0.0, 0.0),
    heading: float = 0.0,
    axes: str = "zyzyzy",
    start: Sequence[float] = START,
) -> Robot:
    """An arm of revolute joints, of generic geometry, on a base that may be turned about z."""
    model, parent = pin.Model(), 0
    place = pin.SE3(pin.utils.rotate("z", heading), np.array(base, dtype=float))
    for k, axis in enumerate(axes):
        parent = model.addJoint(parent, JOINTS[axis](), place, f"joint_{k + 1}")
        offset = np.array(OFFSETS[k % len(OFFSETS)])
        thick = np.diag([0.03, 0.04, 0.02]) * scale * (1.0 + 0.3 * k)
        body = pin.Inertia(scale * (3.0 - 0.35 * k), 0.5 * offset + 0.02, thick)
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
        place = pin.SE3(np.eye(3), offset)
    tool = pin.SE3(pin.utils.rotate("x", 0.4), np.array([0.02, 0.03, 0.1]))
    model.addFrame(pin.Frame("tool", parent, tool, pin.FrameType.OP_FRAME))
    q = np.array(start[: len(axes)], dtype=float)
    return Robot(
        name=name,
        model=model,
        tool_frame="tool",
        initial_position=q,
        axes=("x", "y", "z"),
        brake_damping=1.0,
    )


def spatial_team(count: int = 2, axes: str = "zyzyzy") -> Team:
    """Different arms `arm_1`, `arm_2`, ... side by side, with similar tool orientations."""
    bend = np.array([0.0, 0.25, -0.2, 0.15, 0.2, -0.1, 0.1])
    robots = []
    for i in range(count):
        base = (0.1 * i, 0.7 * i, 0.0)
        start = (START + i * bend).tolist()
        robots.append(spatial_arm(f"arm_{i + 1}", 1.0 + 0.8 * i, base, 0.2 * i, axes, start))
    return Team(robots)


def random_state(team: Team, rng: np.random.Generator, reach: float = 0.6) -> TeamState:
    """A state near the initial configuration, where no arm is stretched out."""
    step = rng.uniform(-reach, reach, team.n)
    return team.state(team.integrate(team.q0, step), rng.normal(size=team.n))
