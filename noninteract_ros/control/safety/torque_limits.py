# SPDX-License-Identifier: Apache-2.0
"""Limits of torques and of their rates, in an order that keeps the account true.

Each group of the law's forces is scaled as a whole by one number, so that springs stay those of a
potential and dampers stay dampers; nothing is cut joint by joint behind the account.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from noninteract_ros.arrays import Array

FITS = 1.0 + 1e-9  # largest torque over its limit that counts as within it
COSTS = np.array([1.0, 4.0, 16.0, 64.0])  # of giving up decoupling, inputs, springs, dampers


@dataclass(frozen=True, slots=True)
class Shares:
    """Shares of the law's forces that are in force, 0 to 1 each.

    Attributes:
        decoupling: Of sigma Delta and of all that the tank pays.
        inputs: Of the feed-forward of references and of force inputs.
        springs: Of the springs.
        dampers: Of the dampers.
    """

    decoupling: float = 1.0
    inputs: float = 1.0
    springs: float = 1.0
    dampers: float = 1.0

    @property
    def least(self) -> float:
        """Smallest of them."""
        return min(self.decoupling, self.inputs, self.springs, self.dampers)


WHOLE = Shares()


@dataclass(frozen=True, slots=True)
class SafetyReport:
    """Interventions at one tick.

    Attributes:
        shares: Shares that effort and rate limits leave of the law's forces.
        effort_share: Smallest share that effort limits leave.
        rate_share: Smallest share of a joint's change of torque that the rate limit leaves.
        rate_fit: Share of the springs that the rate limit allows at this speed.
        repelled: Joints that a position limit repels, as indices.
        too_fast: Joints that are beyond their velocity limit, as indices.
        finite: True where the law gave a torque at all.
        clipped: True where gravity, repulsion and brakes alone exceed the effort limits.
    """

    shares: Shares = WHOLE
    effort_share: float = 1.0
    rate_share: float = 1.0
    rate_fit: float = 1.0
    repelled: tuple[int, ...] = ()
    too_fast: tuple[int, ...] = ()
    finite: bool = True
    clipped: bool = False

    @property
    def cut(self) -> bool:
        """True where something was cut off from the torque."""
        cut = self.effort_share < 1.0 or self.rate_share < 1.0 or self.rate_fit < 1.0
        return cut or self.clipped

    @property
    def acted(self) -> bool:
        """True where the torque is another one than the law's."""
        return self.cut or bool(self.repelled or self.too_fast) or not self.finite


def fitting(base: Array, groups: Sequence[Array], limits: Array) -> tuple[float, ...]:
    """Return shares of groups of torques with which a sum fits its limits.

    They are the nearest to 1 in the norm that `COSTS` weights, the earlier groups being the
    cheaper ones to give up. As the nearest point of a convex set they are unique, continuous in
    all torques, and 1 where the sum fits as it is.

    Args:
        base: Torque that stays as it is, shape (n,), within the limits of the joints that count.
        groups: Torques, shape (n,) each, one for each of `COSTS`.
        limits: Largest torques, shape (n,); inf for joints that do not count.
    """
    counts = np.isfinite(limits)
    scale = 1.0 / limits[counts]
    parts = np.array([group[counts] * scale for group in groups])
    fixed = base[counts] * scale
    total = fixed + parts.sum(axis=0)
    if not (np.abs(total) > FITS).any():
        return (1.0,) * len(groups)
    # Least distance programming (Lawson and Hanson): y = COSTS (1 - shares), min |y|, G y >= h.
    lost = parts / COSTS[:, None]
    eye = np.eye(len(COSTS))
    G = np.vstack([lost.T, -lost.T, eye, -eye])
    h = np.concatenate([total - 1.0, -total - 1.0, np.zeros(len(COSTS)), -COSTS])
    E = np.vstack([G.T, h])
    solution, _ = nnls(E, np.append(np.zeros(len(COSTS)), 1.0))
    r = E @ solution
    r[-1] -= 1.0
    shares = np.clip(1.0 + r[:-1] / (r[-1] * COSTS), 0.0, 1.0) if r[-1] < 0.0 else 0.0 * COSTS
    over = np.abs(fixed + shares @ parts).max()
    if over > 1.0:  # Rounding; the base is within the limits.
        shares *= _largest(fixed, shares @ parts)
    return tuple(shares.tolist())


def _largest(fixed: Array, rest: Array) -> float:
    """Return the largest share of the rest with |fixed + share rest| <= 1, 0 to 1."""
    room = np.where(rest > 0.0, 1.0 - fixed, 1.0 + fixed)
    over = np.abs(rest) > room
    return float(np.min(np.maximum(room[over], 0.0) / np.abs(rest[over]), initial=1.0))


def slewed(torque: Array, last: Array, room: float) -> tuple[Array, float]:
    """Return a torque no further from the last one than a rate limit allows, joint by joint.

    What is cut is booked; scaling all joints by the worst one would let go of the others.

    Args:
        torque: What is asked for, shape (n,).
        last: Torque of the last tick, shape (n,).
        room: Largest change of a joint [N or N m].

    Returns:
        The torque, and the smallest share of a joint's change that is left.
    """
    change = torque - last
    largest = float(np.abs(change).max())
    if largest <= room:
        return torque, 1.0
    return last + np.clip(change, -room, room), room / largest
