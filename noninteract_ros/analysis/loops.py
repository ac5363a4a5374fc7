# SPDX-License-Identifier: Apache-2.0
"""Closed loops of a team's subtasks, linearised at rest: their modes, and what sampling does."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from noninteract_ros.arrays import Array
from noninteract_ros.control.decoupling import TaskDynamics
from noninteract_ros.control.impedance import Impedance

TICKS_PER_TIME_CONSTANT = 10.0  # fewer make the sampled loop visibly another one than designed


@dataclass(frozen=True)
class Loop:
    """M d2e/dt2 + D de/dt + K e = 0 of one subtask, or of all where the law couples them.

    Without what the team holds and touches, and for a saturating potential at small errors.

    Attributes:
        name: The subtask, or `all subtasks`.
        inertia: Eigenvalues of M, ascending, shape (p,) [kg].
        damping_ratios: By mode, ascending; none for a mode without stiffness.
        slowest: Smallest decay rate of its modes [1/s].
        fastest: Largest magnitude of its eigenvalues [1/s].
        ticks: Ticks per time constant of the fastest mode.
        growth: Largest factor by which the loop, with its torque held over a tick, multiplies a
            mode from tick to tick; stable below 1.
    """

    name: str
    inertia: Array
    damping_ratios: Array
    slowest: float
    fastest: float
    ticks: float
    growth: float

    def warning(self, rate: float) -> str:
        """Why the rate [Hz] is too low for this loop, or an empty text."""
        if self.ticks >= TICKS_PER_TIME_CONSTANT:
            return ""
        enough = TICKS_PER_TIME_CONSTANT * self.fastest
        return (
            f"{self.name}: {rate:g} Hz is low for a mode of {self.fastest:.3g} 1/s, "
            f"{self.ticks:.2g} ticks in its time constant; {enough:.0f} Hz would do"
        )


def closed_loops(
    law: str, dynamics: TaskDynamics, impedance: Impedance, names: tuple[str, ...], rate: float
) -> list[Loop]:
    """The loops that a law closes around the state of `dynamics`, at a rate [Hz]."""
    if law == "natural":
        gains = np.diag(impedance.damping), np.diag(impedance.stiffness)
        return [linearised("all subtasks", dynamics.inertia, *gains, rate)]
    return [
        linearised(
            name,
            inertia,
            np.diag(impedance.damping[part]),
            np.diag(impedance.stiffness[part]),
            rate,
        )
        for name, inertia, part in zip(names, dynamics.inertias, dynamics.slices, strict=True)
    ]


def linearised(name: str, M: Array, D: Array, K: Array, rate: float) -> Loop:
    """Modes of M d2e/dt2 + D de/dt + K e = 0 with matrices (p, p), held over ticks at a rate."""
    feedback = -np.linalg.solve(M, np.hstack([K, D]))
    eye, zero = np.eye(len(M)), np.zeros_like(M)
    eigenvalues = np.linalg.eigvals(np.vstack([np.hstack([zero, eye]), feedback]))
    T = 1.0 / rate
    sampled = np.vstack(
        [np.hstack([eye, T * eye]) + 0.5 * T * T * feedback, np.hstack([zero, eye]) + T * feedback]
    )
    fastest = float(np.abs(eigenvalues).max())
    return Loop(
        name,
        np.linalg.eigvalsh(M),
        _damping_ratios(M, D, K),
        float((-eigenvalues.real).min()),
        fastest,
        rate / fastest if fastest else np.inf,
        float(np.abs(np.linalg.eigvals(sampled)).max()),
    )


def _damping_ratios(M: Array, D: Array, K: Array) -> Array:
    """Of the modes of the undamped loop, which damping couples little; exact for p = 1."""
    squares, modes = eigh(K, M)
    swings = squares > 0.0
    damping = np.einsum("ik,ij,jk->k", modes, D, modes)
    return np.sort(damping[swings] / (2.0 * np.sqrt(squares[swings])))
