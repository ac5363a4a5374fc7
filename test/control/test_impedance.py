# SPDX-License-Identifier: Apache-2.0
"""Potentials, their gradients, and gains by coordinate."""

import numpy as np
import pytest

from noninteract_ros.control.law.impedance import (
    Impedance,
    ImpedanceSettings,
    per_coordinate,
    stack_impedance,
)
from noninteract_ros.errors import ScenarioError
from noninteract_ros.subtasks.kinds.mixed_position import MixedPosition

STIFFNESS = np.array([0.0, 30.0, 400.0, 30.0, 400.0])
BOUND = np.array([3.0, np.inf, np.inf, 2.0, 5.0])
IMPEDANCE = Impedance(STIFFNESS, np.ones(5), BOUND, (None,))
ERRORS = np.random.default_rng(0).normal(size=(50, 5)) * np.logspace(-3, 1, 50)[:, None]


def test_force_is_the_gradient_of_the_potential():
    """h is dV/de, by differences, linear and saturating."""
    step = 1e-5
    for e in ERRORS:
        slope = (IMPEDANCE.potential(e + step) - IMPEDANCE.potential(e - step)) / (2 * step)
        np.testing.assert_allclose(IMPEDANCE.force(e), slope, atol=1e-5)


def test_potential_is_zero_at_the_target_and_positive_elsewhere():
    """V has its only minimum at e = 0 where there is stiffness."""
    assert not IMPEDANCE.potential(np.zeros(5)).any()
    for e in ERRORS:
        assert (IMPEDANCE.potential(e)[1:] > 0.0).all()
        assert IMPEDANCE.potential(e)[0] == 0.0


def test_saturating_force_stays_below_its_bound():
    """For any error, the force of a saturating potential is below max_force."""
    far = IMPEDANCE.force(np.full(5, 1e3))
    assert (np.abs(far) <= BOUND).all()
    np.testing.assert_allclose(far[3:], BOUND[3:], rtol=1e-3)
    np.testing.assert_allclose(IMPEDANCE.force(np.full(5, -1e3)), -far)


def test_saturating_potential_is_linear_near_the_target():
    """Close to the target every potential has its stiffness; without a bound everywhere."""
    e = np.full(5, 1e-6)
    np.testing.assert_allclose(IMPEDANCE.force(e), STIFFNESS * e, rtol=1e-6)
    np.testing.assert_allclose(IMPEDANCE.potential(e), 0.5 * STIFFNESS * e**2, rtol=1e-6)
    far = np.full(5, 7.0)
    np.testing.assert_allclose(IMPEDANCE.force(far)[:3], (STIFFNESS * far)[:3], rtol=1e-15)
    np.testing.assert_allclose(
        IMPEDANCE.potential(far)[:3], (0.5 * STIFFNESS * far**2)[:3], rtol=1e-15
    )


def edges(count: int = 3) -> MixedPosition:
    names = tuple(f"edge_{i}" for i in range(count))
    return MixedPosition("shape", names, ("x", "y"), np.zeros((count, 4)))


def test_numbers_spread_over_coordinates():
    """One number serves all, one per axis repeats for every element, one each is taken as is."""
    np.testing.assert_array_equal(per_coordinate(edges(), "damping", (4.0,)), [4.0] * 6)
    np.testing.assert_array_equal(per_coordinate(edges(), "damping", (1.0, 2.0)), [1.0, 2.0] * 3)
    each = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    np.testing.assert_array_equal(per_coordinate(edges(), "damping", each), each)


@pytest.mark.parametrize("count", [0, 3, 4, 5, 7])
def test_other_counts_are_refused(count):
    """A list of another length is refused with the lengths that fit."""
    with pytest.raises(ScenarioError) as caught:
        per_coordinate(edges(), "damping", (1.0,) * count)
    assert str(caught.value) == (
        f"shape.damping: found {[1.0] * count}, allowed: 1 or 2 or 6 numbers"
    )


def test_settings_of_all_subtasks_are_stacked():
    """Stacked gains follow the subtasks' order; a linear potential has no bound."""
    settings = [
        ImpedanceSettings((1.0, 2.0), (3.0,), inertia=(4.0,)),
        ImpedanceSettings((5.0,), (6.0, 7.0), potential="saturating", max_force=(8.0, 9.0)),
    ]
    stacked = stack_impedance([edges(1), edges(2)], settings)
    np.testing.assert_array_equal(stacked.stiffness, [1.0, 2.0, 5.0, 5.0, 5.0, 5.0])
    np.testing.assert_array_equal(stacked.damping, [3.0, 3.0, 6.0, 7.0, 6.0, 7.0])
    np.testing.assert_array_equal(stacked.max_force, [np.inf, np.inf, 8.0, 9.0, 8.0, 9.0])
    np.testing.assert_array_equal(stacked.inertias[0], [4.0, 4.0])
    assert stacked.inertias[1] is None


def test_a_saturating_potential_needs_its_bound():
    """Without max_force the key is named."""
    settings = ImpedanceSettings((1.0,), (1.0,), potential="saturating")
    with pytest.raises(ScenarioError, match=r"^shape\.max_force: found \[\]"):
        stack_impedance([edges()], [settings])
