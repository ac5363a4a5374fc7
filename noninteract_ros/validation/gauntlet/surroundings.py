# SPDX-License-Identifier: Apache-2.0
"""Random passive environments: springs, dampers, masses, unilateral contacts and doors."""

from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.validation.gauntlet.arrays import SurroundingsArrays

KINDS = ("spring", "door", "mass", "contact", "damper")
# Probabilities of the kinds: the first element couples robots, the others are arbitrary.
FIRST = (0.6, 0.25, 0.1, 0.05, 0.0)
FURTHER = (0.35, 0.15, 0.2, 0.2, 0.1)
# Probabilities of directions: two robots, all coordinates, a single coordinate.
SHAPES = (0.5, 0.35, 0.15)
DAMPED = 0.3  # share of springs with a parallel damper
PRELOAD = 2.0  # [J] largest initial energy of a spring


@dataclass(frozen=True)
class Element:
    """Element of an environment along one direction of all tool coordinates.

    Attributes:
        kind: One of `KINDS`; a door is a body of its own behind a spring.
        direction: Unit vector over the tool coordinates, shape (n,).
        stiffness: Stiffness of the spring, the contact or the door's coupling [N/m].
        damping: Damping of the damper, or parallel to the spring [N s/m].
        mass: Mass carried, or of the door [kg].
        offset: Rest position of the spring or onset of the contact [m].
        hinge: Stiffness of a door to the ground [N/m].
        friction: Damping of a door to the ground [N s/m].
    """

    kind: str
    direction: Array
    stiffness: float = 0.0
    damping: float = 0.0
    mass: float = 0.0
    offset: float = 0.0
    hinge: float = 0.0
    friction: float = 0.0

    def text(self) -> str:
        """Return a description of the element."""
        values = (
            f"{name} {value:.4g}"
            for name, value in vars(self).items()
            if name not in ("kind", "direction") and value
        )
        return (
            f"{self.kind} along [{', '.join(f'{b:.3f}' for b in self.direction)}]: "
            + ", ".join(values)
        )


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number with uniformly distributed logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def random_elements(
    rng: np.random.Generator, robots: int, axes: int, stiffest: float
) -> list[Element]:
    """Draw one to three elements, of which the first often couples robots.

    Args:
        rng: Random number generator.
        robots: Number of robots.
        axes: Number of axes of each robot.
        stiffest: Largest stiffness [N/m].
    """
    return [
        _element(rng, _direction(rng, robots, axes), FIRST if i == 0 else FURTHER, stiffest)
        for i in range(rng.integers(1, 4))
    ]


def _direction(rng: np.random.Generator, robots: int, axes: int) -> Array:
    b = np.zeros(robots * axes)
    shape = rng.choice(3, p=SHAPES)
    if shape == 0:
        pair = rng.choice(robots, 2, replace=False)
        b[pair * axes + rng.integers(axes)] = rng.normal(size=2)
    elif shape == 1:
        b[:] = rng.normal(size=len(b))
    else:
        b[rng.integers(len(b))] = 1.0
    return b / np.linalg.norm(b)


def _element(
    rng: np.random.Generator, b: Array, odds: tuple[float, ...], stiffest: float
) -> Element:
    kind = str(rng.choice(KINDS, p=odds))
    stiffness = log_uniform(rng, 100.0, stiffest)
    damping = log_uniform(rng, 0.1, 30.0) if rng.random() < DAMPED else 0.0
    reach = min(0.03, float(np.sqrt(0.5 * PRELOAD / stiffness)))
    offset = float(np.clip(rng.normal(), -2.0, 2.0)) * reach
    if kind == "spring":
        return Element(kind, b, stiffness, damping, offset=offset * (rng.random() < 0.5))
    if kind == "damper":
        return Element(kind, b, damping=log_uniform(rng, 1.0, 300.0))
    if kind == "mass":
        return Element(kind, b, mass=log_uniform(rng, 0.1, 10.0))
    if kind == "contact":
        return Element(kind, b, stiffness, offset=abs(offset))
    hinge = log_uniform(rng, 100.0, 1e4) if rng.random() < 0.5 else 0.0
    friction = log_uniform(rng, 1.0, 30.0)
    mass = log_uniform(rng, 0.2, 10.0)
    return Element(kind, b, stiffness, damping, mass, hinge=hinge, friction=friction)


def assembled(elements: list[Element], n: int) -> SurroundingsArrays:
    """Assemble the matrices of all elements over n tool coordinates and one per door."""
    m = n + sum(item.kind == "door" for item in elements)
    inertia, stiffness, damping = np.zeros((m, m)), np.zeros((m, m)), np.zeros((m, m))
    rest, preload, body = np.zeros(m), 0.0, n
    contacts: list[tuple[Array, float, float]] = []
    for item in elements:
        b = np.zeros(m)
        b[:n] = item.direction
        outer = np.outer(b, b)
        if item.kind == "contact":
            contacts.append((b, item.stiffness, item.offset))
            continue
        if item.kind == "mass":
            inertia += item.mass * outer
            continue
        if item.kind == "door":
            b[body] = -1.0
            outer = np.outer(b, b)
            inertia[body, body], stiffness[body, body] = item.mass, item.hinge
            damping[body, body] = item.friction
            body += 1
        stiffness += item.stiffness * outer
        damping += item.damping * outer
        rest += item.stiffness * item.offset * b
        preload += 0.5 * item.stiffness * item.offset**2
    return SurroundingsArrays(
        inertia,
        stiffness,
        damping,
        rest,
        preload,
        np.array([b for b, _, _ in contacts]).reshape(-1, m),
        np.array([k for _, k, _ in contacts]),
        np.array([gap for _, _, gap in contacts]),
    )
