# SPDX-License-Identifier: Apache-2.0
"""Memory, measurements and constants of the loop of a case."""

from typing import NamedTuple

import numpy as np

from noninteract_ros.arrays import Array

NATURAL, NONINTERACTING, PAPER, GATED = 0, 1, 2, 3
SETTLED, UNBOUNDED, UNSETTLED, ESCAPED = 0, 1, 2, 3
STRETCHED = 0.2  # smallest |sin| of the elbow of a planar arm within its workspace
TRACED = 10  # columns of a trace before q


class DelayedLink(NamedTuple):
    """Delay and losses between states and torques.

    Attributes:
        period: Control period [s].
        delay: Delay from a state to its torque [ticks].
        lost: Share of lost states.
        seed: Seed of the losses.
    """

    period: float
    delay: int
    lost: float
    seed: int


class Limits(NamedTuple):
    """Limits of the simulation of a case.

    Attributes:
        least: Smallest number of ticks.
        most: Largest number of ticks.
        window: Ticks of a window for the largest speed; two consecutive windows must be quiet.
        quiet: Speed at rest relative to its peak.
        growth: Unbounded energy relative to the initial one.
    """

    least: int
    most: int
    window: int
    quiet: float
    growth: float


class Meter(NamedTuple):
    """Measurements of a run, as mutable arrays of one element except `sums` and `least`.

    Speeds are square roots of twice the kinetic energy of robots and bodies together; energies
    are in joules.

    Attributes:
        peak: Largest speed so far.
        last: Largest speed in this window.
        before: Largest speed in the window before.
        sums: Sum of sigma, ticks with sigma = 1, ticks.
        least: Smallest sigma, nu and level of the tank.
        residual: Largest r = W - W(0) - supplied energy.
        mismatch: Largest |r + L|, which only rounding and the plant keep from zero.
        imbalance: Sum over ticks of the energy error of the plant.
        sampling: Largest error of an account with power times time instead of measured work.
        naive: Current value of that error.
        now: Current r.
    """

    peak: Array
    last: Array
    before: Array
    sums: Array
    least: Array
    residual: Array
    mismatch: Array
    imbalance: Array
    sampling: Array
    naive: Array
    now: Array


class Memory(NamedTuple):
    """State of the loop from tick to tick.

    Attributes:
        q: Configuration of the plant, shape (m,).
        v: Velocity of the plant, shape (m,).
        q_received: Configuration of the team in the last received state, shape (n,).
        v_received: Velocity of the team in the last received state, shape (n,).
        pending: Delayed torques of impedance, decoupling and open dampers, (delay + 1, 3, n).
        torque: Applied torque, shape (n,).
        force: Work space for task forces, shape (n,) each.
        received: Time and gravitational energy of the last received state.
        environment: Potential and kinetic energy of the environment.
        began: Initial storage of the port and energy of the environment.
        heat: Heat of the environment since the start.
    """

    q: Array
    v: Array
    q_received: Array
    v_received: Array
    pending: Array
    torque: Array
    force: tuple[Array, Array]
    received: Array
    environment: Array
    began: Array
    heat: Array


def new_meter() -> Meter:
    """Create a meter."""
    one = [np.zeros(1) for _ in range(8)]
    low = np.full(1, -np.inf)
    return Meter(one[0], one[1], one[2], np.zeros(3), np.array([1.0, 1.0, np.inf]), low, *one[3:8])


def new_memory(start: Array, n: int, delay: int) -> Memory:
    """Create the memory at the start."""
    return Memory(
        q=start[0].copy(),
        v=start[1].copy(),
        q_received=np.zeros(n),
        v_received=np.zeros(n),
        pending=np.zeros((delay + 1, 3, n)),
        torque=np.zeros(n),
        force=(np.zeros(n), np.zeros(n)),
        received=np.zeros(2),
        environment=np.zeros(2),
        began=np.zeros(2),
        heat=np.zeros(1),
    )
