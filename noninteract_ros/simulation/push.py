# SPDX-License-Identifier: Apache-2.0
"""A person or an object pushing a robot, at its tool point or anywhere else on it."""

from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import ScenarioError, one_of
from noninteract_ros.schema import join, key
from noninteract_ros.team.team import Team

RESOLUTION = 1e-9  # [s] what lies less apart is the same instant


@dataclass(frozen=True, slots=True)
class Push:
    """A wrench that acts on a robot now.

    Attributes:
        frame: Full name of the frame at whose origin it acts, `<robot>/<frame>`.
        wrench: Force and torque, shape (6,) [N, N m].
        in_frame_axes: Whether it is given in axes of the frame instead of the world.
    """

    frame: str
    wrench: Array
    in_frame_axes: bool = False


@dataclass(frozen=True)
class ScheduledPush:
    """Configuration block of a push that the scenario itself gives.

    What acts elsewhere than on the tool is not in the robot's `external_wrench`: no sensor at
    the tool feels it.
    """

    robot: str = key("Robot that is pushed")
    start: float = key("When it begins [s]", minimum=0.0)
    duration: float = key("How long it lasts [s]", positive=True)
    force: tuple[float, ...] = key("Force, world axes x, y, z [N]")
    torque: tuple[float, ...] = key("Torque, world axes x, y, z [N m]", (0.0, 0.0, 0.0))
    frame: str = key(
        "Link, joint or frame of the robot at whose origin it acts; by default its tool", ""
    )

    def wrench(self, now: float) -> Array:
        """Wrench at a time, shape (6,) [N, N m]."""
        acts = -RESOLUTION < now - self.start < self.duration - RESOLUTION
        return np.array([*self.force, *self.torque]) if acts else np.zeros(6)

    def on_tool(self, team: Team) -> bool:
        """Whether it acts on the robot's tool."""
        return self.frame in ("", team.robots[team.index(self.robot)].tool_frame)

    def frame_name(self, team: Team) -> str:
        """Full name of the frame at whose origin it acts."""
        tool = team.robots[team.index(self.robot)].tool_frame
        return f"{self.robot}/{self.frame or tool}"

    def check(self, name: str, team: Team) -> None:
        """Refuses what does not fit the team.

        Raises:
            ScenarioError: The robot or its frame is unknown, or the force or the torque has not
                three components.
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
    """The newest push that came from outside; it lapses when it is not repeated.

    Attributes:
        push: What it does.
        until: Time at which it lapses [s].
    """

    push: Push
    until: float
