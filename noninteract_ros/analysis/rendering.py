# SPDX-License-Identifier: Apache-2.0
"""A film strip of arms in motion, drawn without a display: joints, links and tool paths."""

from typing import Any

import numpy as np
import pinocchio as pin
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from noninteract_ros.analysis.recorded import Recorded
from noninteract_ros.analysis.style import COLOURS, styled
from noninteract_ros.arrays import Array
from noninteract_ros.team.team import PRISMATIC

FRAMES = 6
COLUMNS = 3
PATH_POINTS = 300
VIEW = (22.0, -62.0)  # elevation and azimuth [degrees]


@styled
def motion_figure(recorded: Recorded) -> Figure:
    """Poses of the team at equal distances in time, tools joined as they hold something."""
    rows = np.linspace(0, len(recorded.t) - 1, FRAMES).astype(int)
    skeletons = [_skeleton(recorded, row) for row in rows]
    paths = _tool_paths(recorded)
    corners = np.concatenate([np.concatenate(arms) for arms in skeletons])
    centre = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    half = 0.5 * np.ptp(corners, axis=0).max()
    figure = Figure(figsize=(9.0, 5.8))
    FigureCanvasAgg(figure)
    for number, (row, arms) in enumerate(zip(rows, skeletons, strict=True)):
        axes: Any = figure.add_subplot(FRAMES // COLUMNS, COLUMNS, number + 1, projection="3d")
        _draw(axes, arms, paths[:, : _until(recorded, int(row))])
        axes.set(
            xlim=(centre[0] - half, centre[0] + half),
            ylim=(centre[1] - half, centre[1] + half),
            zlim=(centre[2] - half, centre[2] + half),
        )
        axes.set_box_aspect((1, 1, 1), zoom=1.5)
        axes.view_init(*VIEW)
        axes.set_axis_off()
        axes.set_title(f"{recorded.t[row]:.1f} s", fontsize=9, y=0.9)
    return figure


def _draw(axes: Any, arms: list[Array], paths: Array) -> None:
    """Shadows on the ground, links and joints, the tools' paths and what lies between tools."""
    for number, points in enumerate(arms):
        colour = COLOURS[number % len(COLOURS)]
        ground = np.zeros(len(points))
        axes.plot(points[:, 0], points[:, 1], ground, color="#CCCCCC", linewidth=2.5)
        axes.plot(*points.T, color=colour, linewidth=3.5, marker="o", markersize=3.5)
        axes.plot(*paths[number].T, color=colour, linewidth=0.8, alpha=0.8)
    tools = np.array([points[-1] for points in arms])
    axes.plot(*tools.T, color="black", linewidth=2.5, linestyle=(0, (2, 1)))


def _until(recorded: Recorded, row: int) -> int:
    return 1 + row * (PATH_POINTS - 1) // max(1, len(recorded.t) - 1)


def _tool_paths(recorded: Recorded) -> Array:
    """Tool points at some of the states, shape (robots, PATH_POINTS, 3) [m]."""
    still = np.zeros(recorded.team.n)
    rows = np.linspace(0, len(recorded.t) - 1, PATH_POINTS).astype(int)
    points = [recorded.team.state(recorded.q[row], still).tool_positions for row in rows]
    return np.array(points).transpose(1, 0, 2)


def _skeleton(recorded: Recorded, row: int) -> list[Array]:
    """Base, joints and tool point of each arm, only the latter of a point mass, (k, 3) [m]."""
    team = recorded.team
    data = team.model.createData()
    pin.framesForwardKinematics(team.model, data, recorded.q[row])
    arms = []
    for robot in team.robots:
        joints = [
            data.oMi[number].translation.copy()
            for number, name in enumerate(team.model.names)
            if name.startswith(f"{robot.name}/")
        ]
        tool = team.model.getFrameId(f"{robot.name}/{robot.tool_frame}")
        points = [robot.base_pose.translation, *joints, data.oMf[tool].translation.copy()]
        slides = all(joint.shortname() in PRISMATIC for joint in robot.model.joints[1:])
        arms.append(np.array(points[-1:] if slides else points))
    return arms
