# SPDX-License-Identifier: Apache-2.0
"""Image sequence and animation of a run from collision geometry, without a display."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from noninteract_ros.arrays import Array
from noninteract_ros.reporting.recording.recorded import Recorded
from noninteract_ros.reporting.rendering.painter import Camera, outlines, paint, shadows
from noninteract_ros.reporting.rendering.scene import Scene, Snapshot
from noninteract_ros.reporting.rendering.style import COLOURS, styled
from noninteract_ros.scenario.shapes import NO_ROBOT
from noninteract_ros.simulation.environment import Wall
from noninteract_ros.team.geometry.hulls import Hull

SNAPSHOTS, COLUMNS = 6, 3
VIEW = (-62.0, 24.0)  # azimuth and elevation [degrees]
VIEW_OF_FLAT = (-90.0, 62.0)
BODY_COLOUR, PUSH_COLOUR, WALL_COLOUR = "#D9B36C", "#D00000", "#8899AA"
EDGE_COLOUR = "#555555"
TRIAD = ("#C03030", "#2E8B57", "#2050C0")  # x, y, z of a tool
GRID = "#EEEEEE"
MARGIN = 0.04
MIN_ASPECT = 0.5  # smallest height of an image over its width
FRAME_TIME = 0.1  # [s] between images of the animation
MAX_DURATION = 8.0  # [s] longer runs are played faster
WIDTH, ANIMATION_WIDTH = 9.0, 5.2  # [in]
PIXELS_PER_INCH = 100  # of the animation
PALETTE = 128  # colours of the animation
APART = 0.004  # smallest visible distance of a ghost from its robot, relative to the radius

Bodies = list[tuple[int, Hull]]


class Animation:
    """Images of one run from a fixed camera.

    Args:
        recorded: The run.

    Raises:
        RecordingError: The run has no finite joint state.
    """

    def __init__(self, recorded: Recorded) -> None:
        self._recorded = recorded
        self.scene = Scene(recorded)
        view = VIEW_OF_FLAT if self.scene.flat else VIEW
        self._camera = Camera.towards(self.scene.centre, self.scene.radius, *view)
        self._ground = 0.0
        self._limits = np.zeros((2, 2))
        self._frame_everything()

    @property
    def aspect(self) -> float:
        """Height of an image over its width."""
        width, height = np.ptp(self._limits, axis=0)
        return float(height / width)

    @property
    def duration(self) -> float:
        """Duration of the run [s]."""
        return float(self._recorded.t[-1] - self._recorded.t[0])

    def rows(self, count: int) -> NDArray[np.intp]:
        """Return the rows of `count` states equally spaced in time."""
        states = self.scene.states
        t = self._recorded.t[states]
        return states[np.searchsorted(t, np.linspace(t[0], t[-1], count) - 1e-9)]

    def _frame_everything(self) -> None:
        """Set the height of the ground and the limits of the image."""
        points = []
        for row in self.rows(12):
            hulls = self.scene.hulls(self.scene.snapshot(int(row)).q)
            points.append(np.concatenate([hull.points for _, hull in hulls]))
        vertices = np.concatenate(points)
        self._ground = float(vertices[:, 2].min())
        image = self._camera.project(vertices)
        low, high = image.min(axis=0), image.max(axis=0)
        width = max((high - low)[0], (high - low)[1])
        room = np.maximum(high - low, MIN_ASPECT * width) - (high - low) + 2.0 * MARGIN * width
        self._limits = np.stack((low - room / 2.0, high + room / 2.0))

    def draw(self, axes: Axes, snapshot: Snapshot) -> None:
        """Draw one snapshot."""
        hulls = self.scene.hulls(snapshot.q)
        bodies = [(_colour(owner), hull) for owner, hull in hulls]
        self._draw_ground(axes)
        shadows(axes, self._camera, bodies, self._ground)
        self._draw_walls(axes)
        outlines(axes, self._camera, self._ghosts(snapshot, hulls))
        self._draw_lines(axes, snapshot)
        paint(axes, self._camera, bodies)
        self._draw_tools(axes, snapshot)
        for point, force in self.scene.pushes(snapshot):
            self._draw_push(axes, point, force)
        axes.set(xlim=self._limits[:, 0], ylim=self._limits[:, 1], aspect="equal")
        axes.set_axis_off()
        label = f"{snapshot.time:.1f} s"
        axes.text(0.02, 0.98, label, transform=axes.transAxes, va="top", fontsize=9, zorder=9)

    def _ghosts(self, snapshot: Snapshot, hulls: Bodies) -> list[tuple[str, Hull]]:
        """Return the robot links that are visibly away from their references."""
        if snapshot.ghost is None:
            return []
        ghosts = self.scene.hulls(snapshot.ghost)
        apart = APART * self.scene.radius
        return [
            (_colour(owner), ghost)
            for (owner, hull), (_, ghost) in zip(hulls, ghosts, strict=True)
            if owner != NO_ROBOT and np.abs(ghost.points - hull.points).max() > apart
        ]

    def _draw_ground(self, axes: Axes) -> None:
        reach = 1.2 * self.scene.radius
        steps, far = np.linspace(-reach, reach, 9), np.full(9, reach)
        zeros = np.zeros(9)
        along = np.stack((steps, -far, zeros, steps, far, zeros), axis=1).reshape(-1, 2, 3)
        across = along[:, :, [1, 0, 2]]
        middle = np.array([*self.scene.centre[:2], self._ground])
        lines = self._camera.project(np.concatenate((along, across)) + middle)
        axes.add_collection(
            LineCollection(list(lines), colors=GRID, linewidths=0.7, zorder=0.5), autolim=False
        )

    def _draw_walls(self, axes: Axes) -> None:
        """Draw each wall as a rectangle of its plane in front of the team."""
        scene = self.scene
        for block in self._recorded.scenario.surroundings.values():
            if not isinstance(block, Wall):
                continue
            normal = np.array(block.normal) / np.linalg.norm(block.normal)
            across = np.cross(normal, [0.0, 0.0, 1.0])
            upright = bool(across.any())
            across = across / np.linalg.norm(across) if upright else np.array([1.0, 0.0, 0.0])
            up = np.cross(across, normal)
            foot = scene.centre - normal * float(normal @ (scene.centre - np.array(block.point)))
            half = scene.radius * np.array([0.8, 0.15 if scene.flat else 0.6])
            signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
            corners = foot + (signs * half) @ np.stack((across, up))
            axes.fill(
                *self._camera.project(corners).T,
                facecolor=WALL_COLOUR,
                edgecolor=WALL_COLOUR,
                alpha=0.35,
                zorder=1.5,
            )

    def _draw_lines(self, axes: Axes, snapshot: Snapshot) -> None:
        """Draw tool paths so far, and edges between robots related by a subtask."""
        scene = self.scene
        until = int(np.searchsorted(scene.path_times, snapshot.time + 1e-9))
        paths = self._camera.project(scene.paths[:until].transpose(1, 0, 2))
        colours = [_colour(number) for number in range(len(paths))]
        tools = np.array([tool.translation for tool in scene.tools(snapshot.q)])
        pairs = self._camera.project(tools[np.array(scene.edges, dtype=int).reshape(-1, 2)])
        for lines, colour, width in ((paths, colours, 0.9), (pairs, EDGE_COLOUR, 1.0)):
            collection = LineCollection(list(lines), colors=colour, linewidths=width, zorder=2.5)
            axes.add_collection(collection, autolim=False)

    def _draw_tools(self, axes: Axes, snapshot: Snapshot) -> None:
        """Draw the tool axes of arms."""
        length = 0.09 * self.scene.radius
        for tool, turns in zip(self.scene.tools(snapshot.q), self.scene.articulated, strict=True):
            if turns:
                ends = tool.translation + length * np.stack((np.zeros((3, 3)), tool.rotation.T))
                lines = self._camera.project(ends.transpose(1, 0, 2))
                axes.add_collection(
                    LineCollection(list(lines), colors=TRIAD, linewidths=1.3, zorder=4.0),
                    autolim=False,
                )

    def _draw_push(self, axes: Axes, point: Array, force: Array) -> None:
        """Draw a push as an arrow to its point of application."""
        start = point - 0.35 * self.scene.radius * force / np.linalg.norm(force)
        tail, head = self._camera.project(np.stack((start, point)))
        style = {"color": PUSH_COLOUR, "linewidth": 2.0, "arrowstyle": "-|>", "mutation_scale": 12}
        axes.annotate("", head, tail, arrowprops=style, zorder=6)


def _colour(owner: int) -> str:
    return BODY_COLOUR if owner == NO_ROBOT else COLOURS[owner % (len(COLOURS) - 1)]


@styled
def motion_figure(animation: Animation) -> Figure:
    """Draw the team at equally spaced times, with a ghost at its references."""
    rows = SNAPSHOTS // COLUMNS
    figure = Figure(figsize=(WIDTH, WIDTH / COLUMNS * rows * animation.aspect))
    FigureCanvasAgg(figure)
    figure.set_layout_engine("none")
    for number, row in enumerate(animation.rows(SNAPSHOTS)):
        down, across = divmod(number, COLUMNS)
        corner = across / COLUMNS, 1.0 - (down + 1) / rows
        axes = figure.add_axes((*corner, 1.0 / COLUMNS, 1.0 / rows))
        animation.draw(axes, animation.scene.snapshot(int(row)))
    return figure


@styled
def save_animation(animation: Animation, path: Path) -> Path:
    """Write the motion as a GIF, in real time up to `MAX_DURATION`."""
    pictures = _pictures(
        animation,
        animation.rows(max(2, round(min(MAX_DURATION, animation.duration) / FRAME_TIME))),
    )
    palette = _palette(pictures[:: max(1, len(pictures) // 4)])
    first, *others = [
        picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures
    ]
    first.save(
        path, save_all=True, append_images=others, duration=round(1000 * FRAME_TIME), loop=0
    )
    return path


def _pictures(animation: Animation, rows: NDArray[np.intp]) -> list[Image.Image]:
    """Draw states as images of equal size."""
    size = (ANIMATION_WIDTH, ANIMATION_WIDTH * animation.aspect)
    figure = Figure(figsize=size, dpi=PIXELS_PER_INCH)
    canvas = FigureCanvasAgg(figure)
    figure.set_layout_engine("none")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    pictures = []
    for row in rows:
        axes.clear()
        animation.draw(axes, animation.scene.snapshot(int(row)))
        canvas.draw()
        pictures.append(Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB"))
    return pictures


def _palette(pictures: Sequence[Image.Image]) -> Image.Image:
    """Return a palette of the images that includes the colours of thin lines."""
    width, height = pictures[0].size
    strip = height // 4
    joined = Image.new("RGB", (width, height * len(pictures) + strip))
    for number, picture in enumerate(pictures):
        joined.paste(picture, (0, number * height))
    lines = (*TRIAD, PUSH_COLOUR, *COLOURS)
    for number, colour in enumerate(lines):
        left, right = (width * place // len(lines) for place in (number, number + 1))
        joined.paste(colour, (left, height * len(pictures), right, joined.height))
    return joined.quantize(PALETTE)
