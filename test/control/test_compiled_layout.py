# SPDX-License-Identifier: Apache-2.0
"""Compiled differences of single values and motions equal those of the layout."""

import numpy as np
import pytest

from noninteract_ros.control.fast.compiled_layout import CompiledLayout
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.layout import Layout

LAYOUTS = {
    "scalars": Layout((2, 1), (False, False)),
    "poses": Layout((3, 3), (True, True)),
    "mixed": Layout((0, 2, 1), (True, False, True)),
}


def motion(layout, rng, size):
    x = rng.normal(size=layout.size)
    x[layout.quaternions] = so3.exp(size * rng.normal(size=(len(layout.quaternions), 3)))
    velocity, acceleration = rng.normal(size=(2, layout.dim))
    return x, velocity, acceleration


@pytest.mark.parametrize("name", LAYOUTS)
@pytest.mark.parametrize("size", [0.0, 1e-9, 0.3, 2.0])
@pytest.mark.parametrize("dt", [0.0, 0.001, 0.7])
def test_compiled_differences_equal_those_of_the_layout(name, size, dt):
    layout, rng = LAYOUTS[name], np.random.default_rng(0)
    for _ in range(5):
        here, before = motion(layout, rng, size), motion(layout, rng, size)
        found, wanted = (
            (item.difference(here[0], before[0]), *item.deviation(here, before, dt))
            for item in (CompiledLayout(layout), layout)
        )
        for one, other in zip(found, wanted, strict=True):
            np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-12)


def test_differences_of_angles_are_the_shortest_ones():
    layout = Layout((2,), (False,), (True,))
    x, x_d = np.array([3.0, 7.0]), np.array([-3.0, 0.0])
    found = CompiledLayout(layout).difference(x, x_d)
    np.testing.assert_allclose(found, layout.difference(x, x_d), atol=1e-15)
    np.testing.assert_allclose(found, [6.0 - 2.0 * np.pi, 7.0 - 2.0 * np.pi], atol=1e-15)


def test_read_only_arrays_are_accepted():
    layout = CompiledLayout(LAYOUTS["poses"])
    x = layout.identity.copy()
    x.flags.writeable = False
    assert not layout.difference(x, x).any()
