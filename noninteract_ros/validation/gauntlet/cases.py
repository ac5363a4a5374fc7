# SPDX-License-Identifier: Apache-2.0
"""Random cases of the gauntlet: unequal robots, gains and passive environments."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from noninteract_ros.arrays import Array
from noninteract_ros.validation.gauntlet.arrays import SurroundingsArrays, TeamArrays
from noninteract_ros.validation.gauntlet.planar import arm_inertia, arm_jacobian, arm_tool
from noninteract_ros.validation.gauntlet.surroundings import (
    Element,
    assembled,
    log_uniform,
    random_elements,
)

TEAMS = ((2, 1), (2, 2), (3, 1), (3, 2))  # robots and axes of teams of point masses
ARMS_EVERY = 5  # every fifth case has planar arms
UNLIKE = (2.0, 8.0)  # mass of the other robots relative to the lightest one
STIFFNESS = (10.0, 2000.0)  # [N/m]
GRASP = ((10.0, 200.0), (200.0, 2000.0))  # [N/m] soft mean and stiff differences
GRASPING = 0.5  # share of the cases with gains as for a grasp
ARMS_STIFFNESS = (200.0, 2000.0)  # [N/m] softer arms leave their workspace
ARMS_GRASP = ((100.0, 300.0), (500.0, 3000.0))  # [N/m]
RATIO = (0.1, 2.0)  # damping ratio of each subtask by itself
FASTEST = 100.0  # [rad/s] largest natural frequency of a subtask by itself
SAFE = 0.5  # gains relative to the limit due to delay and sampling
GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True)
class Case:
    """One case: team, gains, environment and initial state.

    Attributes:
        index: Number of the case.
        team: Robots, subtasks and gains.
        around: Environment as matrices.
        elements: Elements of the environment.
        start: q and v at the start, robots first, shape (2, m).
        robots: Number of robots.
        axes: Number of axes of each robot.
    """

    index: int
    team: TeamArrays
    around: SurroundingsArrays
    elements: list[Element]
    start: Array
    robots: int
    axes: int

    @property
    def arms(self) -> bool:
        """True if the robots are planar arms."""
        return len(self.team.arms) > 0

    @property
    def linear(self) -> bool:
        """True if the loop of a law without gates is linear."""
        return not self.arms and not len(self.around.gaps)

    @property
    def kind(self) -> str:
        """Short description of robots and environment."""
        robots = "planar arms" if self.arms else f"point masses on {self.axes} axes"
        return f"{self.robots} {robots}; {', '.join(item.kind for item in self.elements)}"


def make_case(seed: int, index: int, reaction: float) -> Case:
    """Create a case, determined by seed, number and reaction time alone.

    Args:
        seed: Seed of the gauntlet.
        index: Number of the case.
        reaction: Mean age of the applied torque, half a tick plus the delay [s]; limits the gains
            to those stable without environment.
    """
    rng = np.random.default_rng([seed, index])
    if index % ARMS_EVERY == ARMS_EVERY - 1:
        return _arms_case(rng, index, reaction)
    robots, axes = TEAMS[index % ARMS_EVERY]
    n = robots * axes
    ratio = np.array([log_uniform(rng, *UNLIKE) for _ in range(robots)])
    ratio[rng.integers(robots)] = 1.0
    masses = np.repeat(log_uniform(rng, 0.5, 2.0) * ratio, axes)
    mixing = task_matrix(robots, axes)
    S = np.linalg.inv(mixing)
    between = GRASP if rng.random() < GRASPING else (STIFFNESS, STIFFNESS)
    gains = _gains(rng, S.T @ np.diag(masses) @ S, axes, between, reaction)
    elements = random_elements(rng, robots, axes, 1e5)
    team = TeamArrays(n, axes, mixing, S, masses, np.zeros((0, 7)), np.zeros(n), *gains)
    around = assembled(elements, n)
    start = np.zeros((2, len(around.rest)))
    start[:, :n] = rng.normal(size=(2, n)) * [[0.05], [0.2]]
    return Case(index, team, around, elements, start, robots, axes)


def _arms_case(rng: np.random.Generator, index: int, reaction: float) -> Case:
    gravity = GRAVITY * float(rng.random() < 0.5)
    unlike = rng.permutation([1.0, log_uniform(rng, *UNLIKE)])
    base = log_uniform(rng, 0.5, 2.0)
    arms = np.array([_arm(rng, base * ratio, gravity) for ratio in unlike])
    q = np.ravel([_pose(rng) for _ in arms])
    mixing = task_matrix(2, 2)
    S = np.linalg.inv(mixing)
    H = np.zeros((4, 4))
    for i in range(2):
        own = slice(2 * i, 2 * i + 2)
        back = np.linalg.inv(np.reshape(arm_jacobian(arms, i, q), (2, 2)))
        H[own, own] = back.T @ np.reshape(arm_inertia(arms, i, q), (2, 2)) @ back
    between = ARMS_GRASP if rng.random() < GRASPING else (ARMS_STIFFNESS, ARMS_STIFFNESS)
    gains = _gains(rng, S.T @ H @ S, 2, between, reaction)
    elements = random_elements(rng, 2, 2, 2e4)
    y_ref = np.concatenate([arm_tool(arms, i, q) for i in range(2)])
    team = TeamArrays(4, 2, mixing, S, np.zeros(4), arms, y_ref, *gains)
    around = assembled(elements, 4)
    start = np.zeros((2, len(around.rest)))
    start[:, :4] = rng.normal(size=(2, 4)) * [[0.05], [0.2]]
    start[0, :4] += q
    return Case(index, team, around, elements, start, 2, 2)


def _arm(rng: np.random.Generator, mass: float, gravity: float) -> Array:
    """Return lengths, alpha, beta, delta and gravity torques of two uniform rods, shape (7,)."""
    l1, l2 = rng.uniform(0.4, 0.6, 2)
    m1, m2 = mass * rng.uniform(0.5, 1.5, 2)
    beta, delta = 0.5 * m2 * l1 * l2, m2 * l2**2 / 3.0
    alpha = m1 * l1**2 / 3.0 + m2 * l1**2 + delta
    levers = gravity * (0.5 * m1 + m2) * l1, gravity * 0.5 * m2 * l2
    return np.array([l1, l2, alpha, beta, delta, *levers])


def _pose(rng: np.random.Generator) -> Array:
    return np.array([rng.uniform(-np.pi, np.pi), rng.choice([-1, 1]) * rng.uniform(1.1, 1.9)])


def task_matrix(robots: int, axes: int) -> Array:
    """Return A of the mean and of the differences along a chain, shape (n, n)."""
    rows = np.zeros((robots, robots))
    rows[0] = 1.0 / robots
    for i in range(robots - 1):
        rows[i + 1, i], rows[i + 1, i + 1] = 1.0, -1.0
    return np.kron(rows, np.eye(axes))


def _gains(
    rng: np.random.Generator,
    inertia: Array,
    first: int,
    between: tuple[tuple[float, float], tuple[float, float]],
    reaction: float,
) -> tuple[Array, Array]:
    """Return K and D, shape (n,) each, stable in free motion for the age of the torque."""
    n = len(inertia)
    own = np.diag(inertia)
    stiffness, damping = np.empty(n), np.empty(n)
    for part, limits in zip((slice(0, first), slice(first, n)), between, strict=True):
        ratio, mean = log_uniform(rng, *RATIO), float(own[part].mean())
        # Damping must exceed stiffness times the age of the torque.
        fastest = min(FASTEST, 2.0 * SAFE * ratio / reaction)
        stiffness[part] = min(log_uniform(rng, *limits), fastest**2 * mean)
        damping[part] = 2.0 * ratio * np.sqrt(stiffness[part] * own[part])
    # Damping must not reverse a velocity within the age of the torque.
    strongest = float(eigh(np.diag(damping), inertia, eigvals_only=True)[-1])
    share = min(1.0, SAFE / (strongest * reaction))
    return share**2 * stiffness, share * damping
