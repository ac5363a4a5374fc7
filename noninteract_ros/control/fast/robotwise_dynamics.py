# SPDX-License-Identifier: Apache-2.0
"""Task dynamics robot by robot, at a cost linear in the number of robots.

The stacked Jacobian is J = A T: T has one square block for each robot, which maps its joint
velocities to its tool's velocity and its chosen joints, and A mixes the tools, see
`kernels.array_parts.MixingArrays`, and leaves the joints unchanged. Each robot k has h tool
coordinates: the velocity of its tool point along the axes in use, and its angular velocity in axes
of the tool. In these axes the rotation of a pair has the rate R_a (omega_a - omega_b), a
difference like that of the points. No matrix over the whole team is formed: with L = T^-T M T^-1,
which has a block for each robot as well,

    mean       M_c = B' L B of the columns B of A^-1, at most six
    joints     M_p has the joints' rows and columns of L, since nothing else moves
    edges      M_r^-1 f = A_r w for the tool motion w that keeps the mean and minimises
               w' L w / 2 - f' A_r w: one block for each robot and as many Lagrange multipliers
               as the mean has coordinates

All results equal those of the dense `TaskDynamics` up to rounding. They are computed in machine
code, `kernels.task`, with one call for each method.
"""

from dataclasses import dataclass, fields

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.fast.kernels import task
from noninteract_ros.control.fast.kernels.array_parts import Indices, Plan
from noninteract_ros.control.fast.kernels.inertias import divide_by_inertias
from noninteract_ros.control.law.decoupling import TaskDynamics, task_terms


@dataclass(frozen=True, slots=True, eq=False)
class Coordinates:
    """Indices of the subtasks' coordinates, stacked and robot by robot.

    Attributes:
        h: Number of tool coordinates of a robot.
        plan: Index tables for compiled functions.
        slices: Slice of each subtask in a stacked vector.
        own: Slice of each robot in a vector of all joints.
        chosen: Indices of the chosen joints among the coordinates of all robots (m for each), in
            the order of the subtasks.
    """

    h: int
    plan: Plan
    slices: tuple[slice, ...]
    own: tuple[slice, ...]
    chosen: Indices


class RobotwiseDynamics(TaskDynamics):
    """Task dynamics from terms of each robot; matrices of the team are computed if accessed.

    Args:
        coordinates: Coordinates of the subtasks.
        blocks: Terms of the robots, see `kernels.array_parts.RobotArrays`.
        mixers: The mixing A, see `kernels.array_parts.MixingArrays`.
        G_inverse: Inverse of the sum of all G_k, shape (1, h, h).
        g: Gravity torque, shape (n,).
        desired_inertias: Desired inertia of each subtask, shape (p_i,); None for its own.
    """

    def __init__(
        self,
        coordinates: Coordinates,
        blocks: Array,
        mixers: Array,
        G_inverse: Array,
        g: Array,
        desired_inertias: tuple[Array | None, ...],
    ) -> None:
        values = {
            "coordinates": coordinates,
            "blocks": blocks,
            "g": g,
            "slices": coordinates.slices,
            "desired": desired_inertias,
            "_desired_parts": [
                (part, desired)
                for part, desired in zip(coordinates.slices, desired_inertias, strict=True)
                if desired is not None
            ],
            "_shared": (coordinates.plan, blocks, mixers),
            "_inverse": (coordinates.plan, blocks, mixers, G_inverse),
            "_transposed": [],
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    coordinates: Coordinates
    blocks: Array
    desired: tuple[Array | None, ...]
    _desired_parts: list[tuple[slice, Array]]
    _shared: tuple[Plan, Array, Array]
    _inverse: tuple[Plan, Array, Array, Array]
    _transposed: list[Array]

    def __getattr__(self, name: str) -> object:
        """Compute the matrices of the team at the first access to one of them."""
        if name not in {item.name for item in fields(TaskDynamics)}:
            raise AttributeError(name)
        M, C = self._joined(self.blocks[0]), self._joined(self.blocks[1])
        zero = np.zeros_like(self.g)
        J = np.column_stack([self.velocity(column) for column in np.eye(len(zero))])
        J_rate = np.column_stack([self.acceleration_of(u, zero) for u in np.eye(len(zero))])
        dense = task_terms(M, C, self.g, J, J_rate, self.slices, self.desired)
        for item in fields(TaskDynamics):
            object.__setattr__(self, item.name, getattr(dense, item.name))
        return getattr(dense, name)

    def _joined(self, blocks: Array) -> Array:
        """Return the block-diagonal matrix of the robots' blocks, shape (n, n)."""
        result = np.zeros((len(self.g), len(self.g)))
        for block, part in zip(blocks, self.coordinates.own, strict=True):
            size = part.stop - part.start
            result[part, part] = block[:size, :size]
        return result

    def warm_up(self) -> None:
        """Compile every method, which must not happen within a tick."""
        vector = np.zeros_like(self.g)
        for binary in (self.acceleration_of, self.joint_acceleration, self.torque):
            binary(vector, vector)
        for unary in (
            self.velocity,
            self.coriolis_force,
            self.natural_coriolis_force,
            self.force_of,
            self.multiply_by_inertia,
            self.divide_by_inertia,
            self.multiply_by_inertias,
            self.divide_by_inertias,
            self.decoupled_external_force,
        ):
            unary(vector)
        _ = self.inverse_sizes

    @property
    def inverse_sizes(self) -> Array:
        """Frobenius norm of S, shape (1,)."""
        return np.array([task.inverse_norm(*self._inverse)])

    def velocity(self, v: Array) -> Array:
        """Return J v, shape (n,)."""
        return task.velocity(*self._shared, v)

    def acceleration_of(self, v: Array, joint_acceleration: Array) -> Array:
        """Return J a + (dJ/dt) v, shape (n,)."""
        return task.acceleration_of(*self._shared, v, joint_acceleration)

    def joint_acceleration(self, v: Array, task_acceleration: Array) -> Array:
        """Return S (a - (dJ/dt) v), shape (n,)."""
        return task.joint_acceleration(*self._inverse, v, task_acceleration)

    def torque(self, v: Array, joint_acceleration: Array) -> Array:
        """Return M a + C v + g, shape (n,)."""
        return task.torque(self.coordinates.plan, self.blocks, self.g, v, joint_acceleration)

    def coriolis_force(self, e_rate: Array) -> Array:
        """Return C~_i e_rate_i of every subtask, shape (n,)."""
        force = task.coriolis_force(*self._inverse, e_rate)
        for part, _ in self._desired_parts:
            force[part] = 0.0
        return force

    def natural_coriolis_force(self, e_rate: Array) -> Array:
        """Return mu e_rate, shape (n,)."""
        return task.natural_coriolis_force(*self._inverse, e_rate)

    def force_of(self, torque: Array) -> Array:
        """Return S' tau = A^-T T^-T tau, shape (n,)."""
        return task.force_of(*self._inverse, torque)

    def torque_of(self, force: Array) -> Array:
        """J' f, shape (n,); only near limits and singularities, so that J may be formed."""
        if not self._transposed:
            columns = [self.velocity(column) for column in np.eye(len(self.g))]
            self._transposed.append(np.array(columns))
        return self._transposed[0] @ force

    def multiply_by_inertia(self, acceleration: Array) -> Array:
        """Return Lambda a = A^-T L A^-1 a, shape (n,)."""
        return task.multiply_by_inertia(*self._inverse, acceleration)

    def divide_by_inertia(self, force: Array) -> Array:
        """Return Lambda^-1 f = A L^-1 A' f, shape (n,)."""
        return task.divide_by_inertia(*self._shared, force)

    def divide_by_inertias(self, force: Array) -> Array:
        """Return M_i^-1 f_i of every subtask, shape (n,)."""
        result = divide_by_inertias(*self._shared, force)
        for part, desired in self._desired_parts:
            result[part] = force[part] / desired
        return result

    def multiply_by_inertias(self, acceleration: Array) -> Array:
        """Return M_i a_i of every subtask, shape (n,)."""
        result = task.multiply_by_inertias(*self._inverse, acceleration)
        for part, desired in self._desired_parts:
            result[part] = desired * acceleration[part]
        return result

    def decoupled_external_force(self, external_torque: Array) -> Array:
        """Return M_s J M^-1 tau_e, shape (n,)."""
        return self.multiply_by_inertias(self.acceleration_under(external_torque))

    def acceleration_under(self, torque: Array) -> Array:
        """Return J M^-1 tau, shape (n,)."""
        return task.acceleration_under(*self._shared, torque)
