# SPDX-License-Identifier: Apache-2.0
"""Finds out whether a team's subtasks have the structure of `structured`, and evaluates it."""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.decoupling import TaskDynamics, inverse
from noninteract_ros.control.mixing_terms import MixingTerms
from noninteract_ros.control.robot_terms import RobotByRobot, RobotTerms
from noninteract_ros.control.structured import Coordinates, StructuredDynamics
from noninteract_ros.control.structured_places import Roles, ValuePlaces, coordinates
from noninteract_ros.control.team_view import DeferredState, DeferredTask, DesiredInertias, Seen
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team

SMALLEST = 10  # robots: below, the dense form is the faster one


class Structure:
    """A team whose subtasks are a mean, the edges of a tree, and chosen joints.

    Args:
        team: The robots.
        stack: Their subtasks.
        roles: What `Roles.of` found.
    """

    def __init__(self, team: Team, stack: SubtaskStack, roles: Roles) -> None:
        self._team, self._stack, self._roles = team, stack, roles
        self._robots = RobotByRobot(team)
        self._places: Coordinates = coordinates(team, stack, roles, self._robots)
        self._values, self._rows = ValuePlaces.of(stack), roles.rows
        self._joints_in_q = np.array(roles.in_q, dtype=np.intp)
        self._tree = roles.tree
        count, m, h = len(team.robots), self._robots.m, self._places.h
        self._T = np.tile(np.eye(m), (count, 1, 1))
        self._T[:, :h] = 0.0
        flat = self._T.reshape(-1, m)
        for slot, joint in zip(self._places.slots, roles.in_v, strict=True):
            flat[slot] = 0.0
            flat[slot, self._robots.slots[joint] % m] = 1.0

    @classmethod
    def of(cls, team: Team, stack: SubtaskStack, smallest: int = SMALLEST) -> "Structure | None":
        """The structure of a team of at least `smallest` robots; None if it has or needs none.

        The dense form of a team whose terms are constant costs next to nothing.
        """
        if len(team.robots) < smallest or team.prismatic:
            return None
        roles = Roles.of(team, stack)
        return cls(team, stack, roles) if roles is not None else None

    def evaluate(self, q: Array, v: Array, inertias: DesiredInertias) -> Seen:
        """Everything at a state, with the subtasks' desired inertias."""
        terms, roles = self._robots.evaluate(q, v), self._roles
        tools = terms.rotations
        if roles.offsets is not None:
            tools = tools @ roles.offsets
        x = self._positions(q, terms)
        mean = None
        if roles.rotation is not None:
            quaternions = so3.quaternion(tools)
            q_c, phi = roles.rotation.solve(quaternions)
            mean = roles.rotation.weights, so3.matrix(q_c), phi
            self._put_rotations(x, terms, quaternions, q_c)
        mixing = self._mixing(terms, tools, mean)
        Ts = self._own_jacobians(terms, tools)
        dynamics = StructuredDynamics(self._robots, self._places, terms, mixing, *Ts, v, inertias)
        state = DeferredState(self._team, q, v, terms.g)
        return Seen(state, DeferredTask(x, dynamics), dynamics)

    def again(self, seen: Seen, inertias: DesiredInertias) -> TaskDynamics:
        """Task dynamics of the same state with other desired inertias."""
        return self.evaluate(seen.state.q, seen.state.v, inertias).dynamics

    def _own_jacobians(self, terms: RobotTerms, tools: Array) -> tuple[Array, Array]:
        """T and its time derivative, shape (N, m, m)."""
        roles, h = self._roles, self._places.h
        a = len(self._rows)
        T, T_rate = self._T.copy(), np.zeros_like(self._T)
        T[:, :a], T_rate[:, :a] = terms.J[:, self._rows], terms.J_rate[:, self._rows]
        if roles.rotation is not None:
            turned = tools.transpose(0, 2, 1)
            turning = terms.J_rate[:, 3:] - so3.hat(terms.twists[:, 3:]) @ terms.J[:, 3:]
            T[:, a:h], T_rate[:, a:h] = turned @ terms.J[:, 3:], turned @ turning
        return T, T_rate

    def _mixing(
        self, terms: RobotTerms, tools: Array, mean: tuple[Array, Array, Array] | None
    ) -> MixingTerms:
        roles, tree, h, a = self._roles, self._tree, self._places.h, len(self._rows)
        count = len(tools)
        G, K = np.zeros((count, h, h)), np.zeros((count - 1, h, h))
        G_rate, K_rate = np.zeros_like(G), np.zeros_like(K)
        plain = np.arange(a)
        G[:, plain, plain], K[:, plain, plain] = roles.weights[:, None], 1.0
        H = H_rate = None
        if mean is not None:
            weights, R_c, phi = mean
            spin = so3.hat(terms.twists[:, 3:])
            turning = _turning_of_mean(weights, phi, terms, tools, spin)
            G[:, a:, a:], G_rate[:, a:, a:], omega_c = turning
            first = tools[tree.first]
            K[:, a:, a:], K_rate[:, a:, a:] = first, spin[tree.first] @ first
            if roles.framed_points or roles.framed_rotations:
                H, H_rate = self._framed(terms, tools, R_c, so3.hat(omega_c), K, K_rate)
        return MixingTerms(tree, G, K, H, G_rate, K_rate, H_rate, inverse(G.sum(axis=0)))

    def _framed(
        self, terms: RobotTerms, tools: Array, R_c: Array, spin_c: Array, K: Array, K_rate: Array
    ) -> tuple[Array, Array]:
        """H and its time derivative; K is turned into the frame, in place."""
        roles, tree, a = self._roles, self._tree, len(self._rows)
        H, R = np.zeros_like(K), R_c.T
        H_rate = np.zeros_like(K)
        if roles.framed_points:
            d = tree.differences(terms.positions)
            cross, cross_rate = so3.hat(d), so3.hat(tree.differences(terms.twists[:, :3]))
            K[:, :a, :a], K_rate[:, :a, :a] = R, -R @ spin_c
            H[:, :a, a:], H_rate[:, :a, a:] = R @ cross, R @ (cross_rate - spin_c @ cross)
        if roles.framed_rotations:
            E = tools[tree.first] @ tools[tree.second].transpose(0, 2, 1)
            omega = terms.twists[:, 3:, None]
            omega_E = (omega[tree.first] - E @ omega[tree.second])[..., 0]
            rest = np.eye(3) - E
            turning = K_rate[:, a:, a:] - spin_c @ K[:, a:, a:]
            K[:, a:, a:], K_rate[:, a:, a:] = R @ K[:, a:, a:], R @ turning
            H[:, a:, a:] = -R @ rest
            H_rate[:, a:, a:] = R @ (spin_c @ rest + so3.hat(omega_E) @ E)
        return H, H_rate

    def _positions(self, q: Array, terms: RobotTerms) -> Array:
        """Values of all subtasks, stacked, shape (size,), the rotations still to be put in."""
        x, places = np.empty(self._stack.layout.size), self._values
        points = terms.positions[:, self._rows]
        x[places.joints] = q[self._joints_in_q]
        x[places.mean_position] = self._roles.weights @ points
        x[places.edge_positions] = self._tree.differences(points)
        return x

    def _put_rotations(self, x: Array, terms: RobotTerms, tools: Array, mean: Array) -> None:
        """Quaternions of mean and edges, and positions seen from the mean's frame."""
        roles, tree, places = self._roles, self._tree, self._values
        E = so3.product(tools[tree.first], so3.inverse(tools[tree.second]))
        if roles.framed_rotations:
            E = so3.product(so3.product(so3.inverse(mean), E), mean)
        if roles.framed_points:
            x[places.edge_positions] = tree.differences(terms.positions) @ so3.matrix(mean)
        x[places.mean_rotation] = mean if mean[3] >= 0.0 else -mean
        x[places.edge_rotations] = np.where(E[:, 3:] < 0.0, -E, E)


def _turning_of_mean(
    weights: Array, phi: Array, terms: RobotTerms, tools: Array, spin: Array
) -> tuple[Array, Array, Array]:
    """G of the rotations, its time derivative, and the mean's angular velocity (3,)."""
    w = weights[:, None, None]
    omega = terms.twists[:, 3:, None]
    A = so3.inverse_jacobian(phi)
    weighted = w * A
    B_inverse = inverse(weighted.sum(axis=0).T)
    turned = A @ omega
    omega_c = B_inverse @ (w * turned).sum(axis=0)
    phi_rate = (turned - A.transpose(0, 2, 1) @ omega_c)[..., 0]
    A_rate = w * so3.inverse_jacobian_rate(phi, phi_rate)
    G = B_inverse @ weighted @ tools
    moved = (A_rate + weighted @ spin) @ tools - A_rate.sum(axis=0).T @ G
    return G, B_inverse @ moved, omega_c[:, 0]
