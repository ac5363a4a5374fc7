# SPDX-License-Identifier: Apache-2.0
"""Deviation of a motion from an extrapolated earlier one."""

import numpy as np
import pytest

from noninteract_ros.subtasks.layout import Layout


def motion_of(layout, rng):
    x = layout.sum(layout.identity, rng.normal(size=layout.dim))
    return x, rng.normal(size=layout.dim), rng.normal(size=layout.dim)


@pytest.mark.parametrize("layout", [Layout((3, 2), (True, False)), Layout.scalars(4)])
@pytest.mark.parametrize("dt", [0.0, 0.01, 0.3])
def test_deviation_is_the_relative_motion_to_the_extrapolation(layout, dt):
    rng = np.random.default_rng(0)
    before, motion = motion_of(layout, rng), motion_of(layout, rng)
    expected = layout.relative_motion(motion, layout.extrapolate(before, dt))
    for found, wanted in zip(layout.deviation(motion, before, dt), expected, strict=False):
        np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-13)


def test_extrapolation_of_rest_or_by_no_time_is_the_motion():
    layout = Layout((3,), (True,))
    x, velocity, acceleration = motion_of(layout, np.random.default_rng(1))
    zero = np.zeros(layout.dim)
    assert layout.extrapolate((x, zero, zero), 0.5)[0] is x
    assert layout.extrapolate((x, velocity, acceleration), 0.0)[1] is velocity
