# SPDX-License-Identifier: Apache-2.0
"""Configuration of a point mass."""

import pytest

from noninteract_ros.errors import ScenarioError
from noninteract_ros.team.models.point_mass import PointMass


@pytest.mark.parametrize("axes", [(), ("x", "x"), ("x", "y", "x")])
def test_axes_are_one_to_three_different_ones(axes):
    """No axis, or one axis twice, is refused under the robot's own key."""
    with pytest.raises(ScenarioError, match=r"^left\.axes: found .*different ones of x, y, z"):
        PointMass(1.0, axes=axes).build("left")


def test_initial_position_has_a_number_for_each_axis():
    """A position of another length is refused with the count that is needed."""
    with pytest.raises(ScenarioError, match=r"left\.initial_position: found \[1\.0\].*2 numbers"):
        PointMass(1.0, axes=("x", "z"), initial_position=(1.0,)).build("left")
