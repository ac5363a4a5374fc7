# SPDX-License-Identifier: Apache-2.0
"""Walls at a tick: the acceleration that respects them, and what they push with."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.fast.kernels.active_set import multipliers
from noninteract_ros.control.law.team_dynamics import Evaluation
from noninteract_ros.control.walls.barrier import Push, barrier_push
from noninteract_ros.control.walls.governor import (
    RETURN_RATE,
    Desired,
    advanced,
    arrived,
    target,
)
from noninteract_ros.control.walls.mobility import Indices, giving_way, row_scales
from noninteract_ros.control.walls.rows import JointRows, Rows, pair_rows, stacked
from noninteract_ros.control.walls.settings import REACH, WallSettings
from noninteract_ros.control.walls.state import GovernedMotion, WallState
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.geometry.clearance import Clearances, CollisionGeometry
from noninteract_ros.team.team import Team

ENOUGH = 1e-9  # relative size of a violation that counts as none
PASSES = 10  # times that violated rows are added
SOFTNESS = 1e-7  # added to the diagonal: rows that contradict each other share what is missing


@dataclass(frozen=True)
class WallView:
    """Walls at a state, whatever is asked for.

    Attributes:
        seen: The team.
        rows: Constraints on the joint acceleration.
        M_inverse: Inverse of the team's inertia, shape (n, n).
        barrier: The barrier's push.
        least: Smallest distance between bodies [m], a lower bound beyond the reach of walls.
        nearest: Names of the two.
        orders: Coordinates of the subtasks of each order.
        scales: Scales of the rows of J.
    """

    seen: Evaluation
    rows: Rows
    M_inverse: Array
    barrier: Push
    least: float
    nearest: str
    orders: Sequence[Indices]
    scales: Array

    @cached_property
    def by_order(self) -> Array:
        """Mobility by the order of giving way, shape (n, n)."""
        return giving_way(self.seen.task.J, self.M_inverse, self.orders, self.scales)


@dataclass(frozen=True, slots=True)
class WallForces:
    """Contribution of the walls to the torque of a tick.

    Attributes:
        passive: (1 - sigma) C'l and the barrier's push, shape (n,) [N or N m]: along the walls'
            normals alone.
        paid: What has others give way instead, shape (n,); the tank pays it.
        active: Number of rows that push.
        state: For the next tick.
    """

    passive: Array
    paid: Array
    active: int
    state: WallState


class Walls:
    """Constraints of a team, made once.

    Args:
        team: The robots.
        stack: Their subtasks.
        orders: Order of each subtask: those of a later order give way first.
        scene: Bodies that are to stay apart.
        settings: Margins and rates.
        period: Time between ticks [s].
    """

    def __init__(
        self,
        team: Team,
        stack: SubtaskStack,
        orders: Sequence[int],
        scene: CollisionGeometry,
        settings: WallSettings,
        period: float,
    ) -> None:
        self._team, self._scene, self._settings, self._period = team, scene, settings, period
        start = team.state(team.q0, np.zeros(team.n))
        self._orders = [_coordinates(stack, orders, order) for order in sorted(set(orders))]
        J = stack.evaluate(start).J
        self._scales = row_scales(J, np.linalg.inv(start.M))
        self._joints = JointRows(team, settings, team.joints_from_configuration(team.q0))
        at_start = scene.evaluate(team.q0, np.zeros(team.n))
        self._margins = np.minimum(settings.margin, at_start.distances)
        self._layout = stack.layout

    def view(self, seen: Evaluation, before: WallState) -> WallView:
        """Return the walls at a state of the team, after their own state of the last tick."""
        state = seen.state
        M_inverse, settings = np.linalg.inv(state.M), self._settings
        near = self._near(state.q, state.v)
        margins = self._margins[near.pairs]
        barrier = barrier_push(
            near,
            settings.barrier * margins,
            M_inverse,
            before.stiffness,
            settings.barrier_stiffness,
            self._period,
        )
        nearest = ""
        if len(near.pairs):
            nearest = self._scene.name(int(near.pairs[near.distances.argmin()]))
        rows = stacked(
            self._joints.at(self._team.joints_from_configuration(state.q), state.v),
            pair_rows(near, margins, settings.rate),
        )
        return WallView(
            seen, rows, M_inverse, barrier, near.least, nearest, self._orders, self._scales
        )

    def _near(self, q: Array, v: Array) -> Clearances:
        return self._scene.evaluate(q, v, self._settings.margin + REACH, 1.0 / self._settings.rate)

    def _reference_rows(self, q: Array, v_r: Array) -> Rows:
        """Return the rows for a reference's motion; those of a team inside margins keep it."""
        near = self._near(q, v_r)
        pairs = pair_rows(
            near, np.minimum(self._margins[near.pairs], near.distances), self._settings.rate
        )
        positions = self._team.joints_from_configuration(q)
        return stacked(self._joints.at(positions, v_r, keeps=True), pairs)

    def governed(
        self,
        view: WallView,
        desired: Desired,
        regular: bool,
        before: WallState,
    ) -> tuple[Desired, GovernedMotion | None]:
        """Return references that respect the walls, and their motion for the next tick.

        Where nothing is near, they are the desired ones. Else v_r and x_g are states,

            a_r = S (dd x_d - J_rate v_r + 2 k (d x_d - J v_r) - pull(x_g - x_d)) + W C'l
            C a_r >= b(v_r),   d x_g / dt = J v_r

        so that a team on its references has nothing to give way to. Near a singularity they come
        to rest.

        Args:
            view: The walls.
            desired: Where sources lead.
            regular: True where J has an inverse to rely on.
            before: State of the last tick.
        """
        seen, motion = view.seen, before.governed
        dynamics = seen.dynamics
        if motion is None:
            if not regular:
                return desired, None
            velocity = dynamics.joint_acceleration(np.zeros(self._team.n), desired.velocity)
            motion = GovernedMotion(desired.position, velocity, {})
        v_r, gap = motion.velocity, self._layout.difference(motion.position, desired.position)
        rate = dynamics.velocity(v_r)
        if regular:
            a_r = dynamics.joint_acceleration(v_r, target(desired, gap, rate))
        else:
            a_r = -2.0 * RETURN_RATE * v_r
        rows = self._reference_rows(seen.state.q, v_r)
        missing = rows.b - rows.C @ a_r
        found: Mapping[int, float] = {}
        if motion.multipliers or (missing > 0.0).any():
            found, along = _solved(rows, view.by_order, missing, motion.multipliers)
            a_r = a_r + view.by_order @ along
        if not found and arrived(desired, gap, rate):
            return desired, None
        acceleration = dynamics.acceleration_of(v_r, a_r)
        reference = Desired(motion.position, rate, acceleration)
        motion = replace(motion, multipliers=found)
        return reference, advanced(motion, reference, a_r, self._period, self._layout)

    def forces(self, view: WallView, wanted: Array, sigma: float, before: WallState) -> WallForces:
        """Return the forces of the nearest acceleration within the walls.

            a = wanted + W C'l,   l >= 0,   C a >= b
            W = sigma W_by_order + (1 - sigma) M^-1

        With sigma = 0 walls push along C' alone, as Gauss's principle of least constraint says.

        Args:
            view: The walls.
            wanted: Joint acceleration that law and environment give together, shape (n,).
            sigma: Share of the decoupling in force.
            before: State of the last tick.
        """
        rows, W, barrier = view.rows, view.M_inverse, view.barrier
        none = np.zeros_like(wanted)
        missing = rows.b - rows.C @ wanted
        if not before.multipliers and not (missing > 0.0).any():
            state = replace(before, stiffness=barrier.stiffness)
            return WallForces(barrier.torque, none, 0, state)
        if sigma > 0.0:
            W = (1.0 - sigma) * W + sigma * view.by_order
        found, along = _solved(rows, W, missing, before.multipliers)
        passive = (1.0 - sigma) * along
        paid = view.seen.state.M @ (W @ along) - passive if sigma > 0.0 else none
        state = replace(before, multipliers=found, stiffness=barrier.stiffness)
        return WallForces(passive + barrier.torque, paid, len(found), state)


def _solved(
    rows: Rows, W: Array, missing: Array, before: Mapping[int, float]
) -> tuple[Mapping[int, float], Array]:
    """Return the multipliers of the rows that push, by label, and C'l, shape (n,).

    Rows that are violated at first, or pushed at the last tick, are solved for; what is violated
    then is added.
    """
    chosen = missing > 0.0
    if before:
        chosen |= np.isin(rows.labels, list(before))
    enough = ENOUGH * (1.0 + float(np.abs(missing).max()))
    for _ in range(PASSES):
        some = np.flatnonzero(chosen)
        C = rows.C[some]
        reached = W @ C.T
        G = C @ reached
        G[np.diag_indices_from(G)] *= 1.0 + SOFTNESS
        scale = 1.0 / np.sqrt(np.maximum(np.diag(G), 1e-300))
        found = np.array([before.get(label, 0.0) for label in rows.labels[some].tolist()]) / scale
        multipliers(G * scale[:, None] * scale, missing[some] * scale, found)
        found *= scale
        late = missing - rows.C @ (reached @ found) > enough
        if not (late & ~chosen).any():
            break
        chosen |= late
    active = {
        label: value
        for label, value in zip(rows.labels[some].tolist(), found.tolist(), strict=True)
        if value > 0.0
    }
    return active, C.T @ found


def _coordinates(stack: SubtaskStack, orders: Sequence[int], order: int) -> Indices:
    """Return the coordinates of the subtasks of an order."""
    parts = [s for s, mine in zip(stack.slices, orders, strict=True) if mine == order]
    return np.concatenate([np.arange(part.start, part.stop) for part in parts])
