# SPDX-License-Identifier: Apache-2.0
"""`noninteract check identities`: identities of the law at random states of each team.

Matrices over subtasks and joints mix units: an inertia has kg, kg m and kg m^2. Coordinates are
therefore scaled such that every inertia, M and each M_i, has a unit diagonal:
A -> diag(M)^-1/2 A diag(M)^-1/2 for maps from velocities to forces, and likewise for other maps.
All entries of a matrix then have the same unit, none or 1/s, independent of the choice of units.
A residual is the largest entry of a matrix that should vanish, relative to the largest entry of
its terms. The residual of a torque is the largest over the joints, relative to the sum of
magnitudes of its terms.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.law import decoupling
from noninteract_ros.control.law.decoupling import TaskDynamics, TaskError
from noninteract_ros.control.law.impedance import Impedance
from noninteract_ros.errors import ScenarioError
from noninteract_ros.reporting.checks.check_report import CheckReport, Section
from noninteract_ros.reporting.checks.checks import Check, at_most
from noninteract_ros.scenario.files import find_scenario, known_scenarios, load_scenario
from noninteract_ros.team.models.urdf_files import INSTALL
from noninteract_ros.validation.identities import plain_form
from noninteract_ros.validation.identities.law_probe import LawProbe, Sample

STATES = 1000  # default number of random states of each team

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
    """Identity of the law.

    Attributes:
        short: Short name.
        name: The identity.
        limit: Largest relative residual.
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
"""Identity, name of the law or subtask, and relative residual."""


def check_identities(scenarios: Sequence[str], samples: int | None, seed: int) -> CheckReport:
    """Measure the identities on the teams of scenarios, by default of all known scenarios.

    By default, scenarios whose robot models are not installed are skipped with a warning.

    Raises:
        ScenarioError: A scenario is missing or invalid.
    """
    given = {name: find_scenario(name) for name in scenarios}
    count = samples or STATES
    rows, checks, warnings = [], [], []
    for name, path in (given or known_scenarios()).items():
        try:
            row, found = _measure(name, path, count, seed)
        except ScenarioError as error:
            if given or INSTALL not in str(error):
                raise
            warnings.append(f"{name} skipped: {error}")
            continue
        rows.append(row)
        checks += found
    target = f"identities of the law at {count} random states of each team"
    legend = tuple((item.short, item.name, item.limit) for item in IDENTITIES)
    columns = ("scenario", "rejected states", *(item.short for item in IDENTITIES))
    sections = (
        Section("identities", ("name", "identity", "relative limit"), legend),
        Section("largest relative residuals", columns, tuple(rows)),
    )
    return CheckReport(target, sections, tuple(checks), tuple(warnings), brief=True)


def _measure(
    name: str, path: Path, count: int, seed: int
) -> tuple[tuple[object, ...], list[Check]]:
    """Return the table row and the checks of a scenario."""
    scenario = load_scenario(path)
    team = scenario.build_team()
    stack = scenario.build_stack(team)
    probe = LawProbe(team, stack, scenario.build_controller(team, stack).mode.impedance)
    largest = largest_residuals(probe, count, seed)
    worst = (
        float(np.max([value for (item, _), value in largest.items() if item is identity]))
        for identity in IDENTITIES
    )
    row = (name, probe.rejected, *(f"{value:.1e}" for value in worst))
    return row, residual_checks(largest, f"{name}: ")


def largest_residuals(
    probe: LawProbe, samples: int, seed: int
) -> dict[tuple[Identity, str], float]:
    """Return the largest residual of each identity and law or subtask over random states."""
    largest: dict[tuple[Identity, str], float] = {}
    for sample in probe.samples(samples, seed):
        for identity, which, value in residuals(probe, sample):
            # `maximum` propagates NaN, which must fail; a comparison would drop it.
            before = largest.get((identity, which), 0.0)
            largest[identity, which] = float(np.maximum(before, value))
    return largest


def identities(probe: LawProbe, samples: int, seed: int) -> list[Check]:
    """Check the largest residuals of all identities."""
    return residual_checks(largest_residuals(probe, samples, seed))


def residual_checks(
    largest: Mapping[tuple[Identity, str], float], prefix: str = ""
) -> list[Check]:
    """Check residuals against their limits; names start with the prefix."""
    return [
        at_most(
            prefix + ", ".join(filter(None, (item.name, which))), value, item.limit, "relative"
        )
        for (item, which), value in largest.items()
    ]


def residuals(probe: LawProbe, sample: Sample) -> Iterator[Residual]:
    """Yield all residuals at a state."""
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
    """Return the relative residual of J M^-1 Gamma = blkdiag(M_i^-1): Theorem 1, (16)."""
    inverses = tuple(np.linalg.inv(inertia) for inertia in dynamics.inertias)
    wanted = plain_form.block_diagonal(dynamics, inverses)
    found = dynamics.J @ np.linalg.solve(dynamics.M, plain_form.decoupling_matrix(dynamics))
    sizes = 1.0 / _task_sizes(dynamics)
    wanted = _scaled(wanted, sizes)
    return float(np.abs(_scaled(found, sizes) - wanted).max() / np.abs(wanted).max())


def torque_residual(probe: LawProbe, sample: Sample, law: str) -> float:
    """Return the relative difference of alpha + Gamma tau~_c and inverse dynamics of a law."""
    state, dynamics, error = sample.state, sample.dynamics, sample.error
    gains = probe.impedance
    plain = PLAIN_FORMS[law](dynamics, state.v, error, gains)
    task_acceleration = decoupling.commanded_acceleration(law, dynamics, error, gains)
    wanted = dynamics.joint_acceleration(state.v, task_acceleration)
    fast = probe.team.inverse_dynamics(state.q, state.v, wanted)
    inputs = dynamics.J.T if law == "natural" else plain_form.decoupling_matrix(dynamics)
    terms = np.abs(gains.damping * error.e_rate) + np.abs(gains.force(error.e))
    summed = np.abs(inputs) @ (terms + np.abs(error.force))
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
    """Return the largest entry relative to that of a term [1/s], or to 1/s if it is less."""
    return float(np.abs(residual).max() / (1.0 + np.abs(term).max()))
