# SPDX-License-Identifier: Apache-2.0
"""Figures of arms: torques, regularity and rotations."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from rehearsed import record
from scipy.spatial.transform import Rotation

from noninteract_ros.reporting.figures.figures import tracking_figure
from noninteract_ros.reporting.figures.limits_figure import limits_figure
from noninteract_ros.reporting.recording.recorded import Recorded
from noninteract_ros.scenario.files import find_scenario, nest, read_parameters


def recorded_of(folder: Path, name: str, duration: float, **changes: object) -> Recorded:
    values = nest(dict(read_parameters(find_scenario(name)))) | changes
    return Recorded(record(folder, values, duration))


@pytest.fixture(scope="module")
def arms(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """Planar arms with limits of 60, 30, 150 and 75 N m, at 1 kHz, telemetry at 250 Hz."""
    return recorded_of(tmp_path_factory.mktemp("arms"), "planar_arms", 1.2)


@pytest.fixture(scope="module")
def pandas(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return recorded_of(tmp_path_factory.mktemp("pandas"), "dual_panda_free", 0.4)


def labelled(axes: Axes) -> dict[str, np.ndarray]:
    lines = {str(line.get_label()): line.get_xydata() for line in axes.lines}
    return {label: data for label, data in lines.items() if not label.startswith("_")}


def test_torques_are_drawn_relative_to_their_limits(arms: Recorded) -> None:
    """Each joint has a curve at the telemetry rate; the largest of each robot has its name."""
    shares, _ = limits_figure(arms).axes
    limits = arms.team.effort_limits
    assert np.isfinite(limits).all()
    rows = slice(None, None, 4)
    expected = np.abs(arms.run.joints("joint_states").effort[rows]) / limits
    assert expected.max() > 1e-3
    found = labelled(shares)
    assert list(found) == ["left, largest", "right, largest"]
    for number, data in enumerate(found.values()):
        np.testing.assert_allclose(data[:, 0], arms.t[rows], atol=1e-12)
        own = expected[:, 2 * number : 2 * number + 2]
        np.testing.assert_allclose(data[:, 1], own.max(axis=1), rtol=1e-12)
    drawn = [line.get_ydata() for line in shares.lines if str(line.get_label()).startswith("_")]
    np.testing.assert_allclose(np.sort(drawn, axis=0), np.sort(expected.T, axis=0), rtol=1e-12)
    assert shares.get_ylabel() == "torque / limit"
    assert shares.get_ylim() == (0.0, 1.05)  # The limit itself is in the picture.
    assert shares.figure.legends


def test_torques_without_limits_are_drawn_in_their_unit(tmp_path: Path) -> None:
    """The axis scales to the largest torque."""
    values = nest(dict(read_parameters(find_scenario("planar_arms"))))
    for name in ("left", "right"):
        values[name].pop("effort_limit")
    free = Recorded(record(tmp_path, values, 0.8))
    shares, _ = limits_figure(free).axes
    largest = np.abs(free.torque[::4]).max()
    assert shares.get_ylabel() == "torque [N, N m]"
    drawn = max(data[:, 1].max() for data in labelled(shares).values())
    assert drawn == pytest.approx(largest, rel=1e-12)
    assert shares.get_ylim()[1] > largest


def test_the_smallest_singular_value_is_that_of_the_subtasks(arms: Recorded) -> None:
    """It equals the root of the smallest eigenvalue of J J'; only the lower axis labels time."""
    shares, values = limits_figure(arms).axes
    (line,) = values.lines
    t, found = line.get_xydata().T
    for place in (0, 100, 250):
        row = int(np.searchsorted(arms.t, t[place] - 1e-9))
        J = arms.stack.evaluate(arms.team.state(arms.q[row], np.zeros(4))).J
        assert found[place] == pytest.approx(np.sqrt(np.linalg.eigvalsh(J @ J.T)[0]), rel=1e-6)
    assert values.get_ylim()[0] == 0.0
    assert values.get_ylabel() == "smallest\nsingular value"
    assert (shares.get_xlabel(), values.get_xlabel()) == ("", "time [s]")


def test_rotations_are_drawn_as_the_angle_between_actual_and_desired(pandas: Recorded) -> None:
    """The angle below the positions agrees with SciPy's."""
    *positions, angles = tracking_figure(pandas, "cooperative").axes
    assert len(positions) == 3
    assert angles.get_ylabel() == "orientation\nerror [rad]"
    tracking = pandas.tracking("cooperative")
    actual, desired = (
        Rotation.from_quat(motion.position[:, 3:])
        for motion in (tracking.actual, tracking.desired)
    )
    data = labelled(angles)["angle error"]
    np.testing.assert_allclose(data[:, 0], tracking.t, atol=1e-12)
    np.testing.assert_allclose(data[:, 1], (actual * desired.inv()).magnitude(), atol=1e-7)
    assert data[:, 1].max() > 1e-5
    for column, axes in enumerate(positions):
        np.testing.assert_allclose(
            labelled(axes)["actual"][:, 1], tracking.actual.position[:, column], atol=1e-12
        )
