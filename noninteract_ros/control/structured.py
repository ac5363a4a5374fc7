# SPDX-License-Identifier: Apache-2.0
"""The law's terms robot by robot, at a cost linear in the number of robots.

The stacked Jacobian is J = A T: T has one square block for each robot, to its tool's velocity and
its chosen joints, and A mixes the tools as `MixingTerms` has it and leaves the joints alone. No
matrix over the whole team is formed: with L = T^-T M T^-1, which has a block for each robot too,

    mean       M_c = B' L B of the columns B of A^-1, at most six
    joints     M_p is L's own rows and columns, since nothing else moves
    edges      M_r y = f is the least of w' L w / 2 - f' y over all tool motions w that keep the
               mean, y = A_r w: one block for each robot and as many multipliers as the mean has

All numbers equal those of the dense `TaskDynamics` to rounding.
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.control.decoupling import TaskDynamics, inverses, task_terms
from noninteract_ros.control.mixing_terms import MixingTerms
from noninteract_ros.control.robot_terms import RobotByRobot, RobotTerms

Places = NDArray[np.intp]
Group = tuple[Places, Places, Places]


@dataclass(frozen=True, slots=True, eq=False)
class Coordinates:
    """Where the coordinates of the subtasks are, stacked and robot by robot.

    Attributes:
        h: How many of a robot's coordinates its tool has.
        mean: Places of the mean's in a stacked vector, shape (h,).
        edges: Places of the edges', shape (N - 1, h).
        joints: Places of the chosen joints', shape (P,).
        slots: Places of the latter among N m padded ones, shape (P,).
        slices: Coordinates of each subtask.
        owner: Subtask of each coordinate, shape (n,).
        of_mean: For each subtask, which of h coordinates of the mean it has; None if no mean.
        of_edges: The same for the edges.
        of_joints: For each subtask, groups of robots with equally many chosen joints: robots
            (R, 1), their rows (R, r), and places of these in its vector (R, r).
    """

    h: int
    mean: Places
    edges: Places
    joints: Places
    slots: Places
    slices: tuple[slice, ...]
    owner: Places
    of_mean: tuple[slice | None, ...]
    of_edges: tuple[slice | None, ...]
    of_joints: tuple[tuple[Group, ...], ...]


class StructuredDynamics(TaskDynamics):
    """Task dynamics without matrices of the team; who asks for one gets it made.

    Args:
        robots: Sizes of the robots.
        places: Coordinates of the subtasks.
        terms: Dynamics of the robots.
        mixing: A of the tools.
        T: Own Jacobians, shape (N, m, m).
        T_rate: Their time derivatives.
        v: Velocity of the team, shape (n,).
        desired_inertias: For each subtask, shape (p_i,), or None for its own.
    """

    def __init__(
        self,
        robots: RobotByRobot,
        places: Coordinates,
        terms: RobotTerms,
        mixing: MixingTerms,
        T: Array,
        T_rate: Array,
        v: Array,
        desired_inertias: tuple[Array | None, ...],
    ) -> None:
        T_inverse = inverses(T)
        v_own = robots.padded(v[:, None])
        values = {
            "robots": robots,
            "places": places,
            "terms": terms,
            "mixing": mixing,
            "T": T,
            "T_rate": T_rate,
            "T_inverse": T_inverse,
            "desired": desired_inertias,
            "motion": T @ v_own,
            "drift": T_rate @ v_own,
            "L": T_inverse.transpose(0, 2, 1) @ terms.M @ T_inverse,
            "B": mixing.of_mean(),
            "slices": places.slices,
            "constant": tuple(desired is not None for desired in desired_inertias),
            "g": terms.g,
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    robots: RobotByRobot
    places: Coordinates
    terms: RobotTerms
    mixing: MixingTerms
    T: Array
    T_rate: Array
    T_inverse: Array
    desired: tuple[Array | None, ...]
    motion: Array
    drift: Array
    L: Array
    B: Array

    def __getattr__(self, name: str) -> object:
        """Matrices of the team, the first time that one is asked for."""
        if name not in {item.name for item in fields(TaskDynamics)}:
            raise AttributeError(name)
        identity = np.eye(len(self.g))
        M, C = (
            self.robots.joined(blocks @ self.robots.padded(identity))
            for blocks in (self.terms.M, self.terms.C)
        )
        J = self._stacked(self.T @ self.robots.padded(identity))
        J_rate = self._rate(self.robots.padded(identity))
        dense = task_terms(M, C, self.g, J, J_rate, self.slices, self.desired)
        for item in fields(TaskDynamics):
            object.__setattr__(self, item.name, getattr(dense, item.name))
        return getattr(dense, name)

    @property
    def inverse_sizes(self) -> Array:
        """Frobenius norms of the rows of S of each robot, shape (N,)."""
        h, m = self.places.h, self.robots.m
        squares = np.zeros((len(self.L), m, m))
        squares[:, :h, :h] = self.mixing.inverse_squares(self.B)
        flat = squares.reshape(-1, m)
        flat[self.places.slots, self.places.slots % m] = 1.0
        with np.errstate(invalid="ignore", over="ignore"):
            Q = self.T_inverse.transpose(0, 2, 1) @ self.T_inverse
            return np.sqrt(np.maximum((Q * squares).sum(axis=(1, 2)), 0.0))

    def velocity(self, v: Array) -> Array:
        """J v, shape (n,)."""
        return self._stacked(self.T @ self.robots.padded(v[:, None]))[:, 0]

    def acceleration_of(self, v: Array, joint_acceleration: Array) -> Array:
        """J a + (dJ/dt) v, shape (n,)."""
        return self.velocity(joint_acceleration) + self._rate(self.robots.padded(v[:, None]))[:, 0]

    def joint_acceleration(self, v: Array, task_acceleration: Array) -> Array:
        """S (a - (dJ/dt) v), shape (n,)."""
        places, wanted = self.places, task_acceleration[:, None]
        c_rate, r_rate = self.mixing.rate(self.motion[:, : places.h])
        c, r = wanted[places.mean] - c_rate, wanted[places.edges] - r_rate
        own = self._unmixed(c, r, wanted[places.joints]) - self.drift
        return self.robots.joined(self.T_inverse @ own)[:, 0]

    def coriolis_force(self, e_rate: Array) -> Array:
        """C~_i e_rate_i of every subtask, shape (n,)."""
        force = self._picked(self._coriolis(self._spread(e_rate)))
        for part, constant in zip(self.slices, self.constant, strict=True):
            if constant:
                force[part] = 0.0
        return force

    def natural_coriolis_force(self, e_rate: Array) -> Array:
        """mu e_rate, shape (n,)."""
        return self._coriolis(e_rate[:, None])[:, 0]

    def force_of(self, torque: Array) -> Array:
        """S' tau = A^-T T^-T tau, shape (n,)."""
        own = self.robots.padded(torque[:, None])
        return self._stacked_force(self.T_inverse.transpose(0, 2, 1) @ own)[:, 0]

    def multiply_by_inertia(self, acceleration: Array) -> Array:
        """Lambda a = A^-T L A^-1 a, shape (n,)."""
        return self._stacked_force(self.L @ self._own(acceleration[:, None]))[:, 0]

    def divide_by_inertia(self, force: Array) -> Array:
        """Lambda^-1 f = A L^-1 A' f, shape (n,)."""
        own = np.linalg.solve(self.L, self._own_force(force[:, None]))
        return self._stacked(own)[:, 0]

    def divide_by_inertias(self, force: Array) -> Array:
        """M_i^-1 f_i of every subtask, shape (n,)."""
        result, places = np.empty_like(force), self.places
        for i, part in enumerate(self.slices):
            desired, mean, edges = self.desired[i], places.of_mean[i], places.of_edges[i]
            if desired is not None:
                result[part] = force[part] / desired
            elif mean is not None:
                result[part] = np.linalg.solve(self._mean_inertia(mean), force[part])
            elif edges is not None:
                result[part] = self._divide_edges(edges, force[part])
            else:
                result[part] = self._divide_joints(places.of_joints[i], force[part])
        return result

    def multiply_by_inertias(self, acceleration: Array) -> Array:
        """M_i a_i of every subtask, shape (n,)."""
        result = self._picked(self._stacked_force(self.L @ self._own(self._spread(acceleration))))
        for part, desired in zip(self.slices, self.desired, strict=True):
            if desired is not None:
                result[part] = desired * acceleration[part]
        return result

    def decoupled_external_force(self, external_torque: Array) -> Array:
        """M_s J M^-1 tau_e, shape (n,)."""
        own = np.linalg.solve(self.terms.M, self.robots.padded(external_torque[:, None]))
        return self.multiply_by_inertias(self._stacked(self.T @ own)[:, 0])

    def _coriolis(self, e_rates: Array) -> Array:
        """mu e_rates, shape (n, s)."""
        own = self._own(e_rates)
        u = self.T_inverse @ own
        turned = self._unmixed(*self.mixing.rate(own[:, : self.places.h]), 0.0) + self.T_rate @ u
        force = self.terms.C @ u - self.terms.M @ (self.T_inverse @ turned)
        return self._stacked_force(self.T_inverse.transpose(0, 2, 1) @ force)

    def _mean_inertia(self, part: slice) -> Array:
        h = self.places.h
        B = self.B[:, :, part]
        return (B.transpose(0, 2, 1) @ self.L[:, :h, :h] @ B).sum(axis=0)

    def _divide_edges(self, part: slice, force: Array) -> Array:
        """y = A_r w of the stationary point, with the mean held by multipliers."""
        K, G, tree = self.mixing.K[:, part, part], self.mixing.G[:, part, part], self.mixing.tree
        pushed = tree.gathered(K.transpose(0, 2, 1) @ force.reshape(len(K), -1, 1))
        L_inverse = np.linalg.inv(self.L[:, part, part])
        free, held = L_inverse @ pushed, L_inverse @ G.transpose(0, 2, 1)
        multipliers = np.linalg.solve((G @ held).sum(axis=0), (G @ free).sum(axis=0))
        return (K @ tree.differences(free - held @ multipliers)).ravel()

    def _divide_joints(self, groups: tuple[Group, ...], force: Array) -> Array:
        result = np.empty_like(force)
        for robots, rows, inside in groups:
            if rows.shape[1] == 1:
                result[inside] = force[inside] / self.L[robots, rows, rows]
                continue
            blocks = self.L[robots[:, :, None], rows[:, :, None], rows[:, None, :]]
            result[inside] = np.linalg.solve(blocks, force[inside][..., None])[..., 0]
        return result

    def _spread(self, stacked: Array) -> Array:
        """Each subtask in a column of its own, shape (n, number of subtasks)."""
        columns = np.zeros((len(stacked), len(self.slices)))
        columns[np.arange(len(stacked)), self.places.owner] = stacked
        return columns

    def _picked(self, columns: Array) -> Array:
        """Of each subtask what its own column has, shape (n,)."""
        return columns[np.arange(len(columns)), self.places.owner]

    def _own(self, stacked: Array) -> Array:
        """A^-1: motions of the robots, shape (N, m, s), of stacked ones, shape (n, s)."""
        places = self.places
        return self._unmixed(stacked[places.mean], stacked[places.edges], stacked[places.joints])

    def _unmixed(self, c: Array, r: Array, joints: Array | float) -> Array:
        own = np.zeros((*self.T.shape[:2], c.shape[1]))
        own[:, : self.places.h] = self.mixing.inverse(c, r)
        own.reshape(-1, c.shape[1])[self.places.slots] = joints
        return own

    def _stacked(self, own: Array) -> Array:
        """A: the opposite of `_own`."""
        return self._put(*self.mixing.forward(own[:, : self.places.h]), own)

    def _rate(self, v: Array) -> Array:
        """(dJ/dt) v = (dA/dt) T v + A (dT/dt) v, shape (n, s), of v, shape (N, m, s)."""
        turned = self.mixing.rate((self.T @ v)[:, : self.places.h])
        return self._stacked(self.T_rate @ v) + self._put(*turned, np.zeros_like(v))

    def _own_force(self, stacked: Array) -> Array:
        """A' f, shape (N, m, s)."""
        places = self.places
        own = np.zeros((*self.T.shape[:2], stacked.shape[1]))
        own[:, : places.h] = self.mixing.transposed(stacked[places.mean], stacked[places.edges])
        own.reshape(-1, stacked.shape[1])[places.slots] = stacked[places.joints]
        return own

    def _stacked_force(self, own: Array) -> Array:
        """A^-T: forces on the subtasks, shape (n, s)."""
        return self._put(*self.mixing.inverse_transposed(own[:, : self.places.h]), own)

    def _put(self, c: Array, r: Array, own: Array) -> Array:
        places = self.places
        stacked = np.empty((len(self.g), own.shape[-1]))
        stacked[places.mean], stacked[places.edges] = c, r
        stacked[places.joints] = own.reshape(-1, own.shape[-1])[places.slots]
        return stacked
