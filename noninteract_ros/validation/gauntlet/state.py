# SPDX-License-Identifier: Apache-2.0
"""What the loop of a case remembers and measures, and the numbers that compiled code goes by."""

from typing import NamedTuple

import numpy as np

from noninteract_ros.arrays import Array

NATURAL, NONINTERACTING, PAPER, GATED = 0, 1, 2, 3
SETTLED, UNBOUNDED, UNSETTLED, ESCAPED = 0, 1, 2, 3
STRETCHED = 0.2  # |sin| of the elbow below which a planar arm counts as out of its workspace
TRACED = 10  # columns of a trace before q


class DelayedLink(NamedTuple):
    """Between states and torques.

    Attributes:
        period: Time from tick to tick [s].
        delay: Ticks between a state and the torque that answers it.
        lost: Share of the states that do not arrive.
        seed: Seed of which ones.
    """

    period: float
    delay: int
    lost: float
    seed: int


class Limits(NamedTuple):
    """How long a case is watched and what counts as what.

    Attributes:
        least: Ticks that it runs at least.
        most: Ticks that it runs at most.
        window: Ticks over which the fastest motion is looked for; two in a row have to be quiet.
        quiet: Speed, relative to its peak, below which it is at rest.
        growth: Energy, relative to the first one, from which it is unbounded.
    """

    least: int
    most: int
    window: int
    quiet: float
    growth: float


class Meter(NamedTuple):
    """What is measured along the way, as arrays so that it can be written; all but `sums` of one.

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
        imbalance: Sum over ticks of what the plant itself gained or lost.
        sampling: Largest error of an account with power times time instead of measured work.
        naive: That error now.
        now: r now.
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
        q_seen: Of the team when its state last arrived, shape (n,).
        v_seen: Velocity then, shape (n,).
        pending: Torques of impedance and decoupling under way, shape (delay + 1, 2, n).
        torque: The torque in force, shape (n,).
        force: Room for task forces, shape (n,) each.
        seen: Time and potential energy of the weights when the state last arrived.
        outside: Potential and kinetic energy of the surroundings now.
        began: Port's storage and energy of the surroundings at the start.
        heat: Heat of the surroundings since the start.
    """

    q: Array
    v: Array
    q_seen: Array
    v_seen: Array
    pending: Array
    torque: Array
    force: tuple[Array, Array]
    seen: Array
    outside: Array
    began: Array
    heat: Array


def new_meter() -> Meter:
    """Before the start."""
    one = [np.zeros(1) for _ in range(8)]
    low = np.full(1, -np.inf)
    return Meter(one[0], one[1], one[2], np.zeros(3), np.array([1.0, 1.0, np.inf]), low, *one[3:8])


def new_memory(start: Array, n: int, delay: int) -> Memory:
    """At the start."""
    return Memory(
        q=start[0].copy(),
        v=start[1].copy(),
        q_seen=np.zeros(n),
        v_seen=np.zeros(n),
        pending=np.zeros((delay + 1, 2, n)),
        torque=np.zeros(n),
        force=(np.zeros(n), np.zeros(n)),
        seen=np.zeros(2),
        outside=np.zeros(2),
        began=np.zeros(2),
        heat=np.zeros(1),
    )
