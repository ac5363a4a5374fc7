# SPDX-License-Identifier: Apache-2.0
"""What the law claims of itself, measured at random states of a team.

Matrices over subtasks and joints mix units: an inertia has kg, kg m and kg m^2. So coordinates are
scaled first such that every inertia, M as well as each M_i, has ones on its diagonal:
A -> diag(M)^-1/2 A diag(M)^-1/2 for what maps velocities to forces, and likewise for the others.
Then all entries of a matrix have one unit, none or 1/s, the choice of units drops out, and a
residual is the largest entry of what ought to vanish by the largest one of its terms. A torque's
residual is the largest over the joints, each relative to the sum of the sizes of what its torque
is summed from.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.law import decoupling
from noninteract_ros.control.law.decoupling import TaskDynamics, TaskError
from noninteract_ros.control.law.impedance import Impedance
from noninteract_ros.reporting.checks.checks import Check, at_most
from noninteract_ros.validation.identities import plain_form
from noninteract_ros.validation.identities.law_probe import LawProbe, Sample

PlainForm = Callable[[TaskDynamics, Array, TaskError, Impedance], Array]


def _corrected(dynamics: TaskDynamics, v: Array, error: TaskError, gains: Impedance) -> Array:
    kept = plain_form.subtask_coriolis(dynamics)
    return plain_form.plain_torque(dynamics, v, error, gains, kept)


def _printed(dynamics: TaskDynamics, v: Array, error: TaskError, gains: Impedance) -> Array:
    kept = plain_form.paper_subtask_coriolis(dynamics)
    return plain_form.plain_torque(dynamics, v, error, gains, kept)


def _natural(dynamics: TaskDynamics, v: Array, error: TaskError, gains: Impedance) -> Array:
    return plain_form.natural_torque(dynamics, error, gains)


PLAIN_FORMS: dict[str, PlainForm] = {
    "noninteracting": _corrected,
    "natural": _natural,
    "paper": _printed,
}


@dataclass(frozen=True)
class Identity:
    """A kind of identity.

    Attributes:
        short: A word for it.
        name: The identity.
        limit: Relative residual that it may have.
    """

    short: str
    name: str
    limit: float


DECOUPLED = Identity("Gamma", "J M^-1 Gamma = blkdiag(M_i^-1)", 1e-10)
TORQUES = Identity("torque", "both forms of the torque", 1e-9)
SKEW = Identity("skew", "dM_i/dt - 2 C~_i is skew", 1e-9)
CORIOLIS = Identity("dM/dt", "dM/dt = C + C'", 1e-9)
JACOBIAN = Identity("dJ/dt", "dJ/dt", 1e-9)
IDENTITIES = (DECOUPLED, TORQUES, SKEW, CORIOLIS, JACOBIAN)

Residual = tuple[Identity, str, float]
"""An identity, the law or subtask that it was measured for, and how far it is from holding."""


def largest_residuals(
    probe: LawProbe, samples: int, seed: int
) -> dict[tuple[Identity, str], float]:
    """The largest residual of each identity, for each law or subtask, over random states."""
    largest: dict[tuple[Identity, str], float] = {}
    for sample in probe.samples(samples, seed):
        for identity, which, value in residuals(probe, sample):
            # NaN must stay and fail; a comparison would lose it.
            before = largest.get((identity, which), 0.0)
            largest[identity, which] = float(np.maximum(before, value))
    return largest


def identities(probe: LawProbe, samples: int, seed: int) -> list[Check]:
    """The largest residuals of all identities, against their limits."""
    return claims(largest_residuals(probe, samples, seed))


def claims(largest: Mapping[tuple[Identity, str], float], prefix: str = "") -> list[Check]:
    """Residuals against their limits; the prefix begins the names."""
    return [
        at_most(
            prefix + ", ".join(filter(None, (item.name, which))), value, item.limit, "relative"
        )
        for (item, which), value in largest.items()
    ]


def residuals(probe: LawProbe, sample: Sample) -> Iterator[Residual]:
    """All residuals at a state."""
    state, dynamics = sample.state, sample.dynamics
    yield DECOUPLED, "", decoupling_residual(dynamics)
    for law in PLAIN_FORMS:
        yield TORQUES, law, torque_residual(probe, sample, law)
    kept = plain_form.subtask_coriolis(dynamics)
    for i, name in enumerate(probe.stack.names):
        size = _sizes(dynamics.inertias[i])
        rate = _scaled(sample.rate(_inertia_of(i)), size)
        own = _scaled(kept[i], size)
        yield SKEW, name, _relative(rate - own - own.T, own)
    joints, tasks = _sizes(dynamics.M), _task_sizes(dynamics)
    M_rate, C = _scaled(sample.rate(lambda at: at.M), joints), _scaled(state.C, joints)
    yield CORIOLIS, "", _relative(M_rate - C - C.T, C)
    J_rate = _scaled(sample.rate(lambda at: at.J), 1.0 / tasks, joints)
    yield JACOBIAN, "", _relative(J_rate - _scaled(dynamics.J_rate, 1.0 / tasks, joints), J_rate)


def decoupling_residual(dynamics: TaskDynamics) -> float:
    """How far J M^-1 Gamma is from blkdiag(M_i^-1): Theorem 1, (16)."""
    inverses = tuple(np.linalg.inv(inertia) for inertia in dynamics.inertias)
    wanted = plain_form.block_diagonal(dynamics, inverses)
    found = dynamics.J @ np.linalg.solve(dynamics.M, plain_form.decoupling_matrix(dynamics))
    sizes = 1.0 / _task_sizes(dynamics)
    wanted = _scaled(wanted, sizes)
    return float(np.abs(_scaled(found, sizes) - wanted).max() / np.abs(wanted).max())


def torque_residual(probe: LawProbe, sample: Sample, law: str) -> float:
    """Difference of alpha + Gamma tau~_c and inverse dynamics of the same law."""
    state, dynamics, error = sample.state, sample.dynamics, sample.error
    gains = probe.impedance
    plain = PLAIN_FORMS[law](dynamics, state.v, error, gains)
    task_acceleration = decoupling.commanded_acceleration(law, dynamics, error, gains)
    wanted = dynamics.joint_acceleration(state.v, task_acceleration)
    fast = probe.team.inverse_dynamics(state.q, state.v, wanted)
    inputs = dynamics.J.T if law == "natural" else plain_form.decoupling_matrix(dynamics)
    pull = np.abs(gains.damping * error.e_rate) + np.abs(gains.force(error.e))
    summed = np.abs(inputs) @ (pull + np.abs(error.force))
    summed += np.abs(dynamics.M) @ np.abs(wanted) + np.abs(dynamics.C) @ np.abs(state.v)
    return float((np.abs(fast - plain) / (summed + np.abs(dynamics.g))).max())


def _inertia_of(subtask: int) -> Callable[[TaskDynamics], Array]:
    return lambda dynamics: dynamics.inertias[subtask]


def _sizes(inertia: Array) -> Array:
    return np.sqrt(np.diag(inertia))


def _task_sizes(dynamics: TaskDynamics) -> Array:
    return np.concatenate([_sizes(inertia) for inertia in dynamics.inertias])


def _scaled(matrix: Array, rows: Array, columns: Array | None = None) -> Array:
    return matrix / np.outer(rows, rows if columns is None else columns)


def _relative(residual: Array, term: Array) -> float:
    """Largest entry by that of a term [1/s], and by 1/s where the term is less."""
    return float(np.abs(residual).max() / (1.0 + np.abs(term).max()))
