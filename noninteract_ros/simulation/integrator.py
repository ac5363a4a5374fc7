# SPDX-License-Identifier: Apache-2.0
"""Fixed-step integration of second-order dynamics."""

from collections.abc import Callable
from typing import Protocol

from noninteract_ros.arrays import Array


class ConfigurationSpace(Protocol):
    """Configuration manifold with tangent vectors."""

    def integrate(self, q: Array, step: Array) -> Array:
        """Return the configuration reached from q along a tangent vector."""

    def chart_velocity(self, q_0: Array, q: Array, v: Array) -> Array:
        """Return the rate of the tangent vector from q_0 to q, for the velocity v at q."""


def runge_kutta_step(
    space: ConfigurationSpace,
    derivative: Callable[[Array, Array], tuple[Array, Array]],
    q: Array,
    v: Array,
    step: float,
) -> tuple[Array, Array, Array]:
    """Take one step of the classical Runge-Kutta method, global error O(step^4).

    On curved spaces the method works in the chart of tangent vectors at the start of the step
    (Runge-Kutta-Munthe-Kaas), which keeps the order.

    Args:
        space: Configuration space of q.
        derivative: Function of a state that returns the acceleration, and the rates of quantities
            to integrate.
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,).
        step: Step [s].

    Returns:
        Configuration and velocity after the step, and the increments of the quantities.
    """
    half = 0.5 * step
    a_1, w_1 = derivative(q, v)
    v_2 = v + half * a_1
    q_2 = space.integrate(q, half * v)
    a_2, w_2 = derivative(q_2, v_2)
    u_2 = space.chart_velocity(q, q_2, v_2)
    v_3 = v + half * a_2
    q_3 = space.integrate(q, half * u_2)
    a_3, w_3 = derivative(q_3, v_3)
    u_3 = space.chart_velocity(q, q_3, v_3)
    v_4 = v + step * a_3
    q_4 = space.integrate(q, step * u_3)
    a_4, w_4 = derivative(q_4, v_4)
    u_4 = space.chart_velocity(q, q_4, v_4)
    sixth = step / 6.0
    q_next = space.integrate(q, sixth * (v + 2.0 * (u_2 + u_3) + u_4))
    v_next = v + sixth * (a_1 + 2.0 * (a_2 + a_3) + a_4)
    return q_next, v_next, sixth * (w_1 + 2.0 * (w_2 + w_3) + w_4)
