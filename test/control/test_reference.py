# SPDX-License-Identifier: Apache-2.0
"""References and their extrapolation."""

import numpy as np

from noninteract_ros.subtasks.reference import Reference


def test_extrapolation_follows_constant_acceleration():
    """A fall from (1, 2) m is where elementary mechanics puts it."""
    thrown = Reference(np.array([1.0, 2.0]), np.array([3.0, 0.0]), np.array([0.0, -10.0]))
    later = thrown.extrapolate(0.5)
    np.testing.assert_allclose(later.position, [2.5, 0.75], rtol=1e-15)
    np.testing.assert_allclose(later.velocity, [3.0, -5.0], rtol=1e-15)
    np.testing.assert_array_equal(later.acceleration, thrown.acceleration)


def test_extrapolation_composes():
    """Two steps lead where one step of their sum leads; a step back undoes a step."""
    moving = Reference(np.array([1.0]), np.array([-2.0]), np.array([4.0]))
    for there, direct in (
        (moving.extrapolate(0.3).extrapolate(0.4), moving.extrapolate(0.7)),
        (moving.extrapolate(2).extrapolate(-2), moving),
    ):
        np.testing.assert_allclose(there.position, direct.position, rtol=1e-14)
        np.testing.assert_allclose(there.velocity, direct.velocity, rtol=1e-14)


def test_a_reference_at_rest_copies_its_position_and_stays():
    """A reference at rest is float64, keeps its own copy and never moves."""
    place = [1, 2]
    array = np.array(place, dtype=float)
    rest = Reference.at_rest(array)
    array += 1.0
    assert Reference.at_rest(place).position.dtype == np.float64
    np.testing.assert_array_equal(rest.extrapolate(100.0).position, [1.0, 2.0])
    np.testing.assert_array_equal(rest.velocity, [0.0, 0.0])
