# SPDX-License-Identifier: Apache-2.0
"""Fixed-step integration of second-order dynamics."""

from collections.abc import Callable

from noninteract_ros.arrays import Array


def runge_kutta_step(
    integrate: Callable[[Array, Array], Array],
    acceleration: Callable[[Array, Array], Array],
    q: Array,
    v: Array,
    step: float,
) -> tuple[Array, Array]:
    """One step of the classical Runge-Kutta method, global error O(step^4).

    The order holds on joints whose tangent space commutes: prismatic, revolute, continuous.

    Args:
        integrate: Configuration reached from one along a tangent vector.
        acceleration: dv/dt at a state.
        q: Configuration, shape (nq,).
        v: Velocity, shape (n,).
        step: Step [s].
    """
    half = 0.5 * step
    a_1 = acceleration(q, v)
    v_2 = v + half * a_1
    a_2 = acceleration(integrate(q, half * v), v_2)
    v_3 = v + half * a_2
    a_3 = acceleration(integrate(q, half * v_2), v_3)
    v_4 = v + step * a_3
    a_4 = acceleration(integrate(q, step * v_3), v_4)
    q_next = integrate(q, (step / 6.0) * (v + 2.0 * (v_2 + v_3) + v_4))
    return q_next, v + (step / 6.0) * (a_1 + 2.0 * (a_2 + a_3) + a_4)
