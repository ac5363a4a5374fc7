# SPDX-License-Identifier: Apache-2.0
"""Figures show the recorded data."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from rehearsed import record, scenario_values

from noninteract_ros.reporting.figures.figures import draw, storage_figure, tracking_figure
from noninteract_ros.reporting.figures.paths import paths_figure
from noninteract_ros.reporting.recording.recorded import Recorded


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return Recorded(record(tmp_path_factory.mktemp("pair"), scenario_values(), 1.2))


def swarm_values(count: int) -> dict:
    values = scenario_values(object=None, force_sensors=[], haptic__update_rate=100.0, rate=100.0)
    values["telemetry_rate"] = 50.0
    values["robots"] = [f"robot_{i + 1}" for i in range(count)]
    for i, name in enumerate(values["robots"]):
        values[name] = {"mass": 1.0 + i % 3, "initial_position": [0.5 * (i % 6), 0.5 * (i // 6)]}
    edges = [[0.5, 0.1 * (i % 2)] for i in range(count - 1)]
    values["planner"]["pair"]["value"] = [float(x) for edge in edges for x in edge]
    return values


def labels(figure: Figure) -> list[tuple[str, str]]:
    return [(axes.get_xlabel(), axes.get_ylabel()) for axes in figure.axes]


def curves(figure: Figure) -> list[dict[str, tuple[np.ndarray, str]]]:
    """Data and line style of the labelled lines of each axes."""
    return [
        {
            str(line.get_label()): (line.get_xydata(), line.get_linestyle())
            for line in axes.lines
            if not str(line.get_label()).startswith("_")
        }
        for axes in figure.axes
    ]


def test_the_papers_figure_2(pair: Recorded) -> None:
    """x (top) and y (bottom) over time are as recorded; desired dashed, actual solid."""
    figure = tracking_figure(pair, "cooperative")
    assert labels(figure) == [("", "cooperative\nx [m]"), ("time [s]", "cooperative\ny [m]")]
    tracking = pair.tracking("cooperative")
    for column, found in enumerate(curves(figure)):
        actual, solid = found["actual"]
        desired, dashed = found["desired"]
        assert (solid, dashed) == ("-", "--")
        np.testing.assert_array_equal(actual[:, 1], tracking.actual.position[:, column])
        np.testing.assert_array_equal(desired[:, 1], tracking.desired.position[:, column])


def test_the_papers_figure_3(pair: Recorded) -> None:
    """It shows desired and actual distances between the robots."""
    figure = tracking_figure(pair, "relative")
    assert labels(figure) == [("", "distance\nx [m]"), ("time [s]", "distance\ny [m]")]
    assert [sorted(found) for found in curves(figure)] == [["actual", "desired"]] * 2


def test_the_papers_figure_4(pair: Recorded) -> None:
    """It shows storage (top) and its rate (bottom) from each subtask's start on."""
    figure = storage_figure(pair)
    assert [label for _, label in labels(figure)] == ["storage [J]", "rate of storage [W]"]
    assert figure.axes[1].get_xlabel() == "time since the subtask's start [s]"
    storages, rates = curves(figure)
    assert list(storages) == ["$S_{c}$ (cooperative)", "$S_{r}$ (relative)"]
    assert len(rates) == 2
    for data, _ in storages.values():
        assert data[0, 0] == pytest.approx(0.0, abs=1e-9)
        assert data[0, 1] == pytest.approx(data[:, 1].max(), rel=0.01)


def test_storage_that_does_not_settle_is_shown_to_the_end(tmp_path: Path) -> None:
    """A late push extends the figure to the end; a decayed one ends it earlier."""
    shown = []
    for start in (0.02, 1.8):
        push = {"robot": "robot_1", "start": start, "duration": 0.1, "force": [200.0, 0.0, 0.0]}
        values = scenario_values(object=None, haptic__motion="still", haptic__centre=[0.0, 0.0])
        values |= {"pushes": ["shove"], "shove": push}
        values["cooperative"]["stiffness"] = [200.0]  # Else it would not have settled in 2 s.
        values["planner"]["pair"] = {"time": 0.0, "value": [0.6, 0.8]}
        run = Recorded(record(tmp_path, values, 2.0))
        shown.append(storage_figure(run).axes[0].get_xlim()[1])
    assert shown[0] < 1.9
    assert shown[1] == pytest.approx(1.99, abs=0.02)


def test_paths_pass_through_the_tool_points(pair: Recorded) -> None:
    """Each robot has one path in the plane, to scale."""
    figure = paths_figure(pair)
    assert labels(figure) == [("x [m]", "y [m]")]
    assert figure.axes[0].get_aspect() == 1.0
    found = curves(figure)[0]
    assert list(found) == ["robot_1", "robot_2"]
    np.testing.assert_array_equal(found["robot_1"][0][0], [0.3, 0.4])
    np.testing.assert_array_equal(found["robot_2"][0][-1], pair.q[-1, 2:])


def test_thirty_robots_stay_legible(tmp_path: Path) -> None:
    """Many elements share two legend entries, and each has its lines."""
    recorded = Recorded(record(tmp_path, swarm_values(30), 1.0))
    figure = tracking_figure(recorded, "relative")
    assert [len(axes.lines) for axes in figure.axes] == [2 * 29] * 2
    assert [sorted(found) for found in curves(figure)] == [["actual, 29 elements", "desired"]] * 2
    (legend,) = paths_figure(recorded).legends  # Times of the formations, no names.
    words = [text.get_text() for text in legend.get_texts()]
    assert len(words) < 7
    assert all(word.endswith(" s") for word in words)


@pytest.mark.parametrize(("axes", "expected"), [(["z"], "time [s]"), (["x", "z"], "x [m]")])
def test_teams_on_other_axes(tmp_path: Path, axes: list[str], expected: str) -> None:
    """One axis is drawn over time, any two as a plane."""
    values = scenario_values(object=None, force_sensors=[], haptic=None)
    for name in values["robots"]:
        values[name] = {"mass": 1.0, "axes": axes}
    values["planner"]["pair"]["value"] = [0.5] * len(axes)
    values["cooperative"]["authority"] = "hold"
    recorded = Recorded(record(tmp_path, values, 0.1))
    assert labels(paths_figure(recorded)) == [(expected, "z [m]")]


def test_files_are_written_and_missing_figures_have_a_reason(
    pair: Recorded, tmp_path: Path
) -> None:
    """All figures are images of some size; missing telemetry is the reason for missing ones."""
    files, missing = draw(pair, tmp_path)
    assert [file.name for file in files] == [
        "fig2_cooperative.png",
        "fig3_relative.png",
        "fig4_storage.png",
        "fig5_energy.png",
        "paths.png",
        "motion.png",
        "motion.gif",
    ]
    assert missing == []
    for file in files:
        kind = b"GIF" if file.suffix == ".gif" else b"\x89PNG"
        assert file.read_bytes().startswith(kind)
        assert file.stat().st_size > 10_000

    def bare(topic: str, time: float, arrays: list[np.ndarray]) -> list[np.ndarray] | None:
        return arrays if topic.startswith("joint") else None

    files, missing = draw(Recorded(record(tmp_path, scenario_values(), 0.2, bare)), tmp_path)
    assert [file.name for file in files] == ["paths.png", "motion.png", "motion.gif"]
    assert len(missing) == 4
    assert "cooperative/state is not in the recording" in missing[0]
