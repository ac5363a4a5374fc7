# SPDX-License-Identifier: Apache-2.0
"""Closed loops of a team's subtasks, linearised at rest: their modes, and what sampling does."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import eigh

from noninteract_ros.arrays import Array
from noninteract_ros.control.energy.gate import GATED
from noninteract_ros.control.law.decoupling import TaskDynamics
from noninteract_ros.control.law.impedance import Impedance

TICKS_PER_TIME_CONSTANT = 10.0  # fewer make the sampled loop visibly another one than designed
# Nobody designs the loop that closed gates leave, but it must damp: condition (C2) of the
# derivations, with a command that is one tick late.
TICKS_WITHOUT_DECOUPLING = 3.0
MARGINAL = 1e-9  # growth beyond 1 that rounding may cause where a mode neither grows nor decays
STEP = 2.0**0.125  # factor between the rates and dampings that are tried as cures
TRIALS = 80  # of them, up to a factor of 1024


@dataclass(frozen=True)
class Loop:
    """M d2e/dt2 + D de/dt + K e = 0 of one subtask, or of all where the law couples them.

    Without what the team holds and touches, and for a saturating potential at small errors.

    Attributes:
        name: The subtask, or `all subtasks`.
        M: Inertia, shape (p, p) [kg].
        D: Damping, shape (p, p) [N s/m].
        K: Stiffness, shape (p, p) [N/m].
        rate: Ticks per second [Hz].
        enough: Ticks per time constant of the fastest mode that pass without a warning.
    """

    name: str
    M: Array
    D: Array
    K: Array
    rate: float
    enough: float = TICKS_PER_TIME_CONSTANT

    @cached_property
    def inertia(self) -> Array:
        """Eigenvalues of M, ascending, shape (p,) [kg]."""
        return np.asarray(np.linalg.eigvalsh(self.M))

    @cached_property
    def damping_ratios(self) -> Array:
        """By mode of the undamped loop, ascending; none for a mode without stiffness.

        Damping couples these modes little; for p = 1 the ratio is exact.
        """
        squares, modes = eigh(self.K, self.M)
        swings = squares > 0.0
        damping = np.einsum("ik,ij,jk->k", modes, self.D, modes)
        return np.asarray(np.sort(damping[swings] / (2.0 * np.sqrt(squares[swings]))))

    @cached_property
    def _eigenvalues(self) -> Array:
        """Of the loop in continuous time, shape (2 p,) [1/s]."""
        eye, zero = np.eye(len(self.M)), np.zeros_like(self.M)
        return np.linalg.eigvals(np.vstack([np.hstack([zero, eye]), self._feedback(1.0)]))

    @property
    def slowest(self) -> float:
        """Smallest decay rate of its modes [1/s]."""
        return float((-self._eigenvalues.real).min())

    @property
    def fastest(self) -> float:
        """Largest magnitude of its eigenvalues [1/s]."""
        return float(np.abs(self._eigenvalues).max())

    @property
    def ticks(self) -> float:
        """Ticks per time constant of the fastest mode."""
        return self.rate / self.fastest if self.fastest else np.inf

    @cached_property
    def growth(self) -> float:
        """Largest factor by which the sampled loop multiplies a mode from tick to tick."""
        return self._growth(self.rate, 1.0)

    @property
    def stable(self) -> bool:
        """Whether no mode grows while the torque is held over ticks."""
        return self.growth <= 1.0 + MARGINAL

    def warning(self) -> str:
        """Why it diverges at its rate or is too fast for it, and what would do; or ""."""
        if not self.stable:
            return f"{self.name}: {self.divergence()}"
        if self.ticks >= self.enough:
            return ""
        return (
            f"{self.name}: {self.rate:g} Hz is low for a mode of {self.fastest:.3g} 1/s, "
            f"{self.ticks:.2g} ticks in its time constant; {self.enough * self.fastest:.0f} Hz "
            f"would do"
        )

    def divergence(self) -> str:
        """What an unstable loop does, and the least that would cure it."""
        found = (
            f"held over a tick of {1e3 / self.rate:g} ms, the torque multiplies an error by "
            f"{self.growth:.6g} per tick"
        )
        cures = []
        if higher := _first(lambda factor: self._growth(self.rate * factor, 1.0)):
            cures.append(f"from {self.rate * higher:.0f} Hz on")
        if less := _first(lambda factor: self._growth(self.rate, 1.0 / factor)):
            cures.append(f"with {_percent(1.0 / less)} of its damping")
        elif more := _first(lambda factor: self._growth(self.rate, factor)):
            cures.append(f"with {more:.3g} times its damping")
        return f"{found}; stable {' or '.join(cures)}" if cures else f"{found}; lower its gains"

    def _feedback(self, damping: float) -> Array:
        """Acceleration by error and its rate, shape (p, 2 p), with a multiple of the damping."""
        return -np.linalg.solve(self.M, np.hstack([self.K, damping * self.D]))

    def _growth(self, rate: float, damping: float) -> float:
        """Spectral radius of a tick in which the acceleration is held; infinite for no number."""
        T, feedback = 1.0 / rate, self._feedback(damping)
        eye, zero = np.eye(len(self.M)), np.zeros_like(self.M)
        way = np.hstack([eye, T * eye]) + 0.5 * T * T * feedback
        sampled = np.vstack([way, np.hstack([zero, eye]) + T * feedback])
        if not np.isfinite(sampled).all():
            return np.inf
        return float(np.abs(np.linalg.eigvals(sampled)).max())


def _first(growth: Callable[[float], float]) -> float | None:
    """The smallest factor beyond 1 of those tried at which nothing grows, or None."""
    factors = (STEP**power for power in range(1, TRIALS + 1))
    return next((factor for factor in factors if growth(factor) <= 1.0 + MARGINAL), None)


def _percent(share: float) -> str:
    """In two digits that are never rounded up beyond the share."""
    return f"{95.0 * share:.2g} %"


def closed_loops(
    law: str, dynamics: TaskDynamics, impedance: Impedance, names: tuple[str, ...], rate: float
) -> list[Loop]:
    """The loops that a law can close around the state of `dynamics`, at a rate [Hz].

    Those of `energy_gated` are the noninteracting ones while its gates are open, and the natural
    one when sigma has come to zero: both must be stable.
    """
    damping, stiffness = np.diag(impedance.damping), np.diag(impedance.stiffness)
    if law == "natural":
        return [Loop("all subtasks", dynamics.inertia, damping, stiffness, rate)]
    loops = [
        Loop(name, inertia, damping[part, part], stiffness[part, part], rate)
        for name, inertia, part in zip(names, dynamics.inertias, dynamics.slices, strict=True)
    ]
    if law == GATED:
        name, enough = "all subtasks at sigma = 0", TICKS_WITHOUT_DECOUPLING
        loops.append(Loop(name, dynamics.inertia, damping, stiffness, rate, enough))
    return loops
