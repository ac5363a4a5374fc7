# SPDX-License-Identifier: Apache-2.0
"""Closed loops of a team's subtasks, linearised at rest: modes, and effect of sampling."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import eigh

from noninteract_ros.arrays import Array
from noninteract_ros.control.energy.gate import GATED
from noninteract_ros.control.law.decoupling import TaskDynamics
from noninteract_ros.control.law.impedance import Impedance

TICKS_PER_TIME_CONSTANT = 10.0  # with fewer, the sampled loop differs visibly from its design
# The loop with closed gates is not a design choice, but it must be damped: condition (C2) of the
# derivations, with a command that is one tick late.
TICKS_WITHOUT_DECOUPLING = 3.0
MARGINAL = 1e-9  # growth beyond 1 by rounding, of a mode that neither grows nor decays
STEP = 2.0**0.125  # factor between the rates and dampings that are tried as remedies
TRIALS = 80  # number of these factors, up to 1024


@dataclass(frozen=True)
class Loop:
    """M d2e/dt2 + D de/dt + K e = 0 of one subtask, or of all if the law couples them.

    The loop does not include objects held or touched by the team; a saturating potential is
    linearised at zero error.

    Attributes:
        name: Name of the subtask, or `all subtasks`.
        M: Inertia, shape (p, p) [kg].
        D: Damping, shape (p, p) [N s/m].
        K: Stiffness, shape (p, p) [N/m].
        rate: Control rate [Hz].
        min_ticks: Least ticks per time constant of the fastest mode without a warning.
    """

    name: str
    M: Array
    D: Array
    K: Array
    rate: float
    min_ticks: float = TICKS_PER_TIME_CONSTANT

    @cached_property
    def inertia(self) -> Array:
        """Eigenvalues of M, ascending, shape (p,) [kg]."""
        return np.asarray(np.linalg.eigvalsh(self.M))

    @cached_property
    def damping_ratios(self) -> Array:
        """Damping ratio of each mode of the undamped loop with stiffness, ascending.

        The modes' coupling by damping is neglected; for p = 1 the ratio is exact.
        """
        squares, modes = eigh(self.K, self.M)
        oscillates = squares > 0.0
        damping = np.einsum("ik,ij,jk->k", modes, self.D, modes)
        return np.asarray(np.sort(damping[oscillates] / (2.0 * np.sqrt(squares[oscillates]))))

    @cached_property
    def _eigenvalues(self) -> Array:
        """Eigenvalues of the loop in continuous time, shape (2 p,) [1/s]."""
        eye, zero = np.eye(len(self.M)), np.zeros_like(self.M)
        return np.linalg.eigvals(np.vstack([np.hstack([zero, eye]), self._feedback(1.0)]))

    @property
    def slowest(self) -> float:
        """Smallest decay rate of the modes [1/s]."""
        return float((-self._eigenvalues.real).min())

    @property
    def fastest(self) -> float:
        """Largest magnitude of the eigenvalues [1/s]."""
        return float(np.abs(self._eigenvalues).max())

    @property
    def ticks(self) -> float:
        """Ticks per time constant of the fastest mode."""
        return self.rate / self.fastest if self.fastest else np.inf

    @cached_property
    def growth(self) -> float:
        """Largest growth factor of a mode per tick in the sampled loop."""
        return self._growth(self.rate, 1.0)

    @property
    def stable(self) -> bool:
        """True if no mode grows while the torque is held over ticks."""
        return self.growth <= 1.0 + MARGINAL

    def warning(self) -> str:
        """Return a warning if the loop diverges or is too fast for its rate; otherwise ""."""
        if not self.stable:
            return f"{self.name}: {self.divergence()}"
        if self.ticks >= self.min_ticks:
            return ""
        return (
            f"{self.name}: {self.rate:g} Hz is low for a mode of {self.fastest:.3g} 1/s, "
            f"{self.ticks:.2g} ticks per time constant; {self.min_ticks * self.fastest:.0f} Hz "
            f"is sufficient"
        )

    def divergence(self) -> str:
        """Return a description of an unstable loop, with the least changes that stabilise it."""
        found = (
            f"with the torque held over a tick of {1e3 / self.rate:g} ms, an error grows by a "
            f"factor of {self.growth:.6g} per tick"
        )
        remedies = []
        if higher := _first(lambda factor: self._growth(self.rate * factor, 1.0)):
            remedies.append(f"at {self.rate * higher:.0f} Hz or more")
        if less := _first(lambda factor: self._growth(self.rate, 1.0 / factor)):
            remedies.append(f"with {_percent(1.0 / less)} of its damping")
        elif more := _first(lambda factor: self._growth(self.rate, factor)):
            remedies.append(f"with {more:.3g} times its damping")
        return (
            f"{found}; stable {' or '.join(remedies)}"
            if remedies
            else f"{found}; reduce its gains"
        )

    def _feedback(self, damping: float) -> Array:
        """Return the acceleration per error and rate, shape (p, 2 p), with scaled damping."""
        return -np.linalg.solve(self.M, np.hstack([self.K, damping * self.D]))

    def _growth(self, rate: float, damping: float) -> float:
        """Return the spectral radius of a tick with constant acceleration; inf if not finite."""
        T, feedback = 1.0 / rate, self._feedback(damping)
        eye, zero = np.eye(len(self.M)), np.zeros_like(self.M)
        position = np.hstack([eye, T * eye]) + 0.5 * T * T * feedback
        sampled = np.vstack([position, np.hstack([zero, eye]) + T * feedback])
        if not np.isfinite(sampled).all():
            return np.inf
        return float(np.abs(np.linalg.eigvals(sampled)).max())


def _first(growth: Callable[[float], float]) -> float | None:
    """Return the smallest tried factor above 1 without growth, or None."""
    factors = (STEP**power for power in range(1, TRIALS + 1))
    return next((factor for factor in factors if growth(factor) <= 1.0 + MARGINAL), None)


def _percent(share: float) -> str:
    """Format a share with two digits, never rounded above the share."""
    return f"{95.0 * share:.2g} %"


def closed_loops(
    law: str, dynamics: TaskDynamics, impedance: Impedance, names: tuple[str, ...], rate: float
) -> list[Loop]:
    """Return the loops that a law can close around the state of `dynamics`, at a rate [Hz].

    The loops of `energy_gated` are the noninteracting ones while its gates are open, and the
    natural one at sigma = 0: all must be stable.
    """
    damping, stiffness = np.diag(impedance.damping), np.diag(impedance.stiffness)
    if law == "natural":
        return [Loop("all subtasks", dynamics.inertia, damping, stiffness, rate)]
    loops = [
        Loop(name, inertia, damping[part, part], stiffness[part, part], rate)
        for name, inertia, part in zip(names, dynamics.inertias, dynamics.slices, strict=True)
    ]
    if law == GATED:
        name, min_ticks = "all subtasks at sigma = 0", TICKS_WITHOUT_DECOUPLING
        loops.append(Loop(name, dynamics.inertia, damping, stiffness, rate, min_ticks))
    return loops
