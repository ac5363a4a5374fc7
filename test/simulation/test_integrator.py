# SPDX-License-Identifier: Apache-2.0
"""Integration method on motions with known solutions."""

import numpy as np
import pytest

from noninteract_ros.simulation.integrator import runge_kutta_step


class Line:
    """Real numbers, with differences as tangent vectors."""

    def integrate(self, q, step):
        return q + step

    def chart_velocity(self, q_0, q, v):
        return v


def swing(steps: int) -> float:
    """Return the state error of an oscillator after one second in a number of steps."""
    q, v = np.array([1.0]), np.array([0.0])
    for _ in range(steps):
        q, v, _ = runge_kutta_step(Line(), lambda q, v: (-9.0 * q, np.zeros(0)), q, v, 1.0 / steps)
    return float(np.hypot(q[0] - np.cos(3.0), (v[0] + 3.0 * np.sin(3.0)) / 3.0))


def test_error_falls_with_the_fourth_power_of_the_step():
    """Halving the step divides the error by 16."""
    assert swing(20) / swing(40) == pytest.approx(16.0, rel=0.1)


def test_constant_acceleration_is_exact():
    """A fall is exact in one step."""
    fall = np.array([-9.81])
    q, v, work = runge_kutta_step(
        Line(), lambda q, v: (fall, fall * v), np.array([1.0]), np.array([2.0]), 0.5
    )
    np.testing.assert_allclose([q[0], v[0]], [1.0 + 1.0 - 0.5 * 9.81 * 0.25, 2.0 - 9.81 * 0.5])
    np.testing.assert_allclose(work, 0.5 * (v**2 - 4.0))
