# SPDX-License-Identifier: Apache-2.0
"""Pushes on a robot, at its tool point or at any other frame."""

from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import ScenarioError, one_of
from noninteract_ros.schema import join, key
from noninteract_ros.team.team import Team

RESOLUTION = 1e-9  # Times closer than this are the same instant [s].


@dataclass(frozen=True, slots=True)
class Push:
    """A wrench that acts on a robot at an instant.

    Attributes:
        frame: Full name of the frame at whose origin the wrench acts, `<robot>/<frame>`.
        wrench: Force and torque, shape (6,) [N, N m].
        in_frame_axes: True if the wrench is in axes of the frame instead of the world.
    """

    frame: str
    wrench: Array
    in_frame_axes: bool = False


@dataclass(frozen=True)
class ScheduledPush:
    """Configuration block of a scheduled push.

    A push elsewhere than on the tool is not part of the robot's `external_wrench`, since a sensor
    at the tool does not measure it.
    """

    robot: str = key("Pushed robot")
    start: float = key("Start time [s]", minimum=0.0)
    duration: float = key("Duration [s]", positive=True)
    force: tuple[float, ...] = key("Force, world axes x, y, z [N]")
    torque: tuple[float, ...] = key("Torque, world axes x, y, z [N m]", (0.0, 0.0, 0.0))
    frame: str = key(
        "Link, joint or frame of the robot at whose origin the push acts; by default its tool", ""
    )

    def wrench(self, now: float) -> Array:
        """Return the wrench at a time [s], shape (6,) [N, N m]."""
        active = -RESOLUTION < now - self.start < self.duration - RESOLUTION
        return np.array([*self.force, *self.torque]) if active else np.zeros(6)

    def on_tool(self, team: Team) -> bool:
        """Return True if the push acts on the robot's tool."""
        return self.frame in ("", team.robots[team.index(self.robot)].tool_frame)

    def frame_name(self, team: Team) -> str:
        """Return the full name of the frame at whose origin the push acts."""
        tool = team.robots[team.index(self.robot)].tool_frame
        return f"{self.robot}/{self.frame or tool}"

    def check(self, name: str, team: Team) -> None:
        """Check the push against the team.

        Raises:
            ScenarioError: The robot or its frame is unknown, or the force or the torque does not
                have three components.
        """
        if self.robot not in team.names:
            allowed = one_of(team.names, self.robot)
            raise ScenarioError(join(name, "robot"), repr(self.robot), allowed)
        for item in ("force", "torque"):
            if len(getattr(self, item)) != 3:
                raise ScenarioError(join(name, item), list(getattr(self, item)), "3 numbers")
        frames = [frame.name for frame in team.robots[team.index(self.robot)].model.frames][1:]
        if self.frame and self.frame not in frames:
            allowed = one_of(frames, self.frame)
            raise ScenarioError(join(name, "frame"), repr(self.frame), allowed)


@dataclass(frozen=True, slots=True)
class LivePush:
    """Newest received push on a robot; it expires unless it is repeated.

    Attributes:
        push: The push.
        until: Time of expiry [s].
    """

    push: Push
    until: float
