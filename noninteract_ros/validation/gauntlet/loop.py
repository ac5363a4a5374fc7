# SPDX-License-Identifier: Apache-2.0
"""Linear sampled loop of a case: exact transition over a tick, and its eigenvalues."""

import numpy as np
from scipy.linalg import expm

from noninteract_ros.arrays import Array
from noninteract_ros.validation.gauntlet.cases import Case
from noninteract_ros.validation.gauntlet.plant import ARMS, CONTACT, LINEAR, PlantArrays

SUBSTEPS = 4  # of a tick at 1 kHz; more at lower rates, so that the plant stays the same


def plant_of(case: Case, period: float) -> PlantArrays:
    """Create the plant between two ticks."""
    m, n = case.start.shape[1], case.team.n
    inertia = case.around.inertia.copy()
    inertia[:n, :n] += np.diag(case.team.masses)
    substeps = max(1, round(SUBSTEPS * period / 1e-3))
    vectors = tuple(np.zeros((8, m)))
    square = np.zeros((m, m)), np.zeros((m, m))
    long = np.zeros(2 * m + n + 1), np.zeros(2 * m)
    contacts = np.zeros(len(case.around.gaps)), np.zeros(len(case.around.gaps))
    tick: Array = np.zeros((0, 0))
    loss: Array = np.zeros((0, 0))
    response: Array = np.zeros((0, 0))
    if case.linear:
        tick, loss = held(case, inertia, period)
    elif not case.arms:
        h = period / substeps
        system = 2.0 / h * inertia + case.around.damping + 0.5 * h * case.around.stiffness
        response = np.linalg.inv(system)
    kind = ARMS if case.arms else LINEAR if case.linear else CONTACT
    return PlantArrays(
        kind, substeps, tick, loss, response, inertia, vectors, long, square, contacts
    )


def held(case: Case, inertia: Array, period: float) -> tuple[Array, Array]:
    """Return transition of (z, dz/dt) over a tick and heat, both for w = (z, dz/dt, torque, 1).

    The heat is the integral of Phi' C Phi, by Van Loan's block exponential. Velocities are scaled
    by the period for entries of similar magnitude.
    """
    around, n = case.around, case.team.n
    m = len(around.rest)
    size = 2 * m + n + 1
    loads = np.column_stack([np.eye(m)[:, :n], around.rest])
    forces = np.column_stack([-around.stiffness, -around.damping, loads])
    F = np.zeros((size, size))
    F[:m, m : 2 * m] = np.eye(m)
    F[m : 2 * m] = np.linalg.solve(inertia, forces)
    scale = np.ones(size)
    scale[:m], scale[m : 2 * m] = 1.0, 1.0 / period
    F = period * F * scale / scale[:, None]
    C = np.zeros((size, size))
    C[m : 2 * m, m : 2 * m] = around.damping / period
    blocks = expm(np.block([[-F.T, C], [np.zeros_like(F), F]]))
    Phi = blocks[size:, size:]
    loss = Phi.T @ blocks[:size, size:] / scale[:, None] / scale
    tick = Phi * scale[:, None] / scale
    return np.ascontiguousarray(tick[: 2 * m]), np.ascontiguousarray(0.5 * (loss + loss.T))


def growth_rate(
    case: Case, period: float, delay: int, sigma: float, nu: float, damping: float = 1.0
) -> float:
    """Return the largest growth rate of the sampled loop with constant gates [1/s].

    The monodromy matrix acts on the state of the plant and on the delayed torques.

    Args:
        case: A linear case.
        period: Time from tick to tick [s].
        delay: Ticks between a state and its torque.
        sigma: Gate of the decoupling.
        nu: Gate of the springs.
        damping: Gate of the dampers.
    """
    n, m = case.team.n, case.start.shape[1]
    inertia = case.around.inertia.copy()
    inertia[:n, :n] += np.diag(case.team.masses)
    tick, _ = held(case, inertia, period)
    state, force = tick[:, : 2 * m], tick[:, 2 * m : 2 * m + n]
    feedback = np.zeros((n, 2 * m))
    shaped = _shaping(case, sigma)
    A = case.team.mixing
    feedback[:, :n] = -nu * A.T @ shaped @ (case.team.stiffness[:, None] * A)
    feedback[:, m : m + n] = -damping * A.T @ shaped @ (case.team.damping[:, None] * A)
    if delay == 0:
        monodromy = state + force @ feedback
    else:
        size = 2 * m + n * delay
        monodromy = np.zeros((size, size))
        monodromy[: 2 * m, : 2 * m] = state
        monodromy[: 2 * m, 2 * m : 2 * m + n] = force
        monodromy[2 * m : size - n, 2 * m + n :] = np.eye(size - 2 * m - n)
        monodromy[size - n :, : 2 * m] = feedback
    return float(np.log(np.abs(np.linalg.eigvals(monodromy)).max()) / period)


def _shaping(case: Case, sigma: float) -> Array:
    """Return I + sigma (Lambda blkdiag(M_i)^-1 - I), shape (n, n)."""
    S, n, first = case.team.S, case.team.n, case.team.first
    inertia = S.T @ np.diag(case.team.masses) @ S
    own = inertia.copy()
    own[:first, first:] = own[first:, :first] = 0.0
    return np.eye(n) + sigma * (inertia @ np.linalg.inv(own) - np.eye(n))
