# SPDX-License-Identifier: Apache-2.0
"""Robot team as one Pinocchio model: equations (1) to (3)."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from noninteract_ros.arrays import Array
from noninteract_ros.errors import TeamError
from noninteract_ros.memo import Memo
from noninteract_ros.team.joined_model import append_model
from noninteract_ros.team.joint_coordinates import JointCoordinates
from noninteract_ros.team.robot import Robot

PRISMATIC = ("JointModelPX", "JointModelPY", "JointModelPZ", "JointModelPrismaticUnaligned")


@dataclass(frozen=True, slots=True)
class TeamState:
    """Dynamics and tool kinematics of the team at one state (q, v).

    Attributes:
        q: Configuration, shape (nq,).
        v: Velocity, shape (n,) [m/s or rad/s].
        M: Inertia matrix, shape (n, n), symmetric positive-definite.
        C: Coriolis matrix, shape (n, n); dM/dt - 2 C is skew.
        g: Gravity torque, shape (n,) [N or N m].
        tool_positions: Tool points in the world, shape (N, 3) [m].
        tool_jacobians: Tool Jacobians (linear, angular) in world axes, shape (N, 6, n).
        tool_jacobian_rates: Time derivatives of the tool Jacobians, shape (N, 6, n).
        tool_rotations: Tool orientations in the world, shape (N, 3, 3).
    """

    q: Array
    v: Array
    M: Array
    C: Array
    g: Array
    tool_positions: Array
    tool_jacobians: Array
    tool_jacobian_rates: Array
    tool_rotations: Array


class Team:
    """N robots joined into one model; joints are named `<robot>/<joint>`.

    Args:
        robots: At least two robots with different names.
        gravity: Gravitational acceleration in the world, shape (3,) [m/s^2].

    Attributes:
        robots: Robots, in order.
        names: Names of the robots.
        model: Pinocchio model of the whole team.
        n: Dimension of the velocity, equal to the number of joints.
        joint_names: Names of the joints.
        q0: Initial configuration, shape (nq,).
        velocity_slices: Slice of each robot in a velocity.
        effort_limits: Effort limits, shape (n,) [N or N m]; inf where unlimited.
        velocity_limits: Velocity limits, shape (n,) [m/s or rad/s]; inf where unlimited.
        position_limits: Lower and upper position limits, shape (2, n) [m or rad].
        friction: Viscous friction of the joints, shape (n,) [N s/m or N m s/rad]; not part of
            M, C and g.
        brake_damping: Damping of the robots' brakes, shape (n,) [N s/m or N m s/rad].
        units: Unit of each coordinate of a velocity, m or rad, shape (n,).
        prismatic: True if all joints are prismatic; only tool positions then depend on q.

    Raises:
        TeamError: Fewer than two robots, or a repeated name.
    """

    def __init__(
        self, robots: Sequence[Robot], gravity: Sequence[float] = (0.0, 0.0, -9.81)
    ) -> None:
        names = [robot.name for robot in robots]
        if len(robots) < 2:
            raise TeamError(f"a team has at least 2 robots, found {len(robots)}: {names}")
        if len(set(names)) != len(names):
            raise TeamError(f"each robot needs a unique name, found {names}")
        self.robots = tuple(robots)
        self.names = tuple(names)
        self.model = _join(robots)
        self.model.gravity.linear = np.array(gravity)
        self.n = self.model.nv
        self.joint_names = tuple(self.model.names[1:])
        self.q0 = np.concatenate([robot.initial_position for robot in robots])
        self.velocity_slices = self._slices([robot.model.nv for robot in robots])
        self.brake_damping = np.concatenate(
            [np.full(robot.model.nv, robot.brake_damping) for robot in robots]
        )
        self.effort_limits = np.concatenate([robot.effort_limits for robot in robots])
        self.velocity_limits = np.concatenate([robot.velocity_limits for robot in robots])
        self.position_limits = np.hstack([robot.position_limits for robot in robots])
        self.friction = np.concatenate([robot.model.damping for robot in robots])
        self._coordinates = JointCoordinates(self.model)
        self._data = self.model.createData()
        self._tools = [self.model.getFrameId(f"{r.name}/{r.tool_frame}") for r in robots]
        self._lower = np.tri(self.n, k=-1, dtype=bool)
        joints = self.model.joints[1:]  # Without the universe.
        self.prismatic = all(joint.shortname() in PRISMATIC for joint in joints)
        self.units = tuple(
            "m" if joint.shortname() in PRISMATIC else "rad"
            for joint in joints
            for _ in range(joint.nv)
        )
        self._constant: TeamState | None = None
        self._tool_inverses = Memo(self._compute_tool_inverses)

    def with_own_data(self) -> "Team":
        """Return the same team with computation data of its own, for use in another thread."""
        team = copy(self)
        team._data = self.model.createData()
        team._constant = None
        team._tool_inverses = Memo(team._compute_tool_inverses)
        return team

    @staticmethod
    def _slices(sizes: Sequence[int]) -> tuple[slice, ...]:
        ends = np.cumsum(sizes).tolist()
        return tuple(slice(end - size, end) for size, end in zip(sizes, ends, strict=True))

    def configuration_from_joints(self, positions: Array) -> Array:
        """Return the configuration, shape (nq,), of joint positions, shape (n,)."""
        return self._coordinates.configuration(positions)

    def joints_from_configuration(self, q: Array) -> Array:
        """Return joint positions, shape (n,); those of continuous joints within (-pi, pi]."""
        return self._coordinates.positions(q)

    def difference(self, start: Array, end: Array) -> Array:
        """Return the shortest tangent vector from one configuration to another, shape (n,)."""
        return self._coordinates.difference(start, end)

    def state(self, q: Array, v: Array) -> TeamState:
        """Return dynamics and tool kinematics at (q, v); the arrays must not be modified.

        For a team of prismatic joints all terms except the tool points are constant, and every
        call returns the same arrays.
        """
        if not self.prismatic:
            return self._state(q, v)
        if self._constant is None:
            self._constant = self._state(np.zeros_like(q), np.zeros(self.n))
        known = self._constant
        positions = known.tool_positions + known.tool_jacobians[:, :3] @ q
        return TeamState(
            q=q,
            v=v,
            M=known.M,
            C=known.C,
            g=known.g,
            tool_positions=positions,
            tool_jacobians=known.tool_jacobians,
            tool_jacobian_rates=known.tool_jacobian_rates,
            tool_rotations=known.tool_rotations,
        )

    def _state(self, q: Array, v: Array) -> TeamState:
        model, data = self.model, self._data
        pin.computeAllTerms(model, data, q, v)
        M = data.M.copy()
        np.copyto(M, M.T, where=self._lower)  # Pinocchio fills the upper triangle.
        C = pin.computeCoriolisMatrix(model, data, q, v).copy()
        g = pin.computeGeneralizedGravity(model, data, q).copy()
        count = len(self._tools)
        positions, rotations = np.empty((count, 3)), np.empty((count, 3, 3))
        jacobians = np.empty((count, 6, self.n))
        rates = np.empty((count, 6, self.n))
        axes = pin.LOCAL_WORLD_ALIGNED
        for i, tool in enumerate(self._tools):
            placement = pin.updateFramePlacement(model, data, tool)
            positions[i], rotations[i] = placement.translation, placement.rotation
            jacobians[i] = pin.getFrameJacobian(model, data, tool, axes)
            rates[i] = pin.getFrameJacobianTimeVariation(model, data, tool, axes)
        return TeamState(
            q=q,
            v=v,
            M=M,
            C=C,
            g=g,
            tool_positions=positions,
            tool_jacobians=jacobians,
            tool_jacobian_rates=rates,
            tool_rotations=rotations,
        )

    def inverse_dynamics(self, q: Array, v: Array, acceleration: Array) -> Array:
        """Return the torque M a + C v + g for a joint acceleration, shape (n,) [N or N m]."""
        return pin.rnea(self.model, self._data, q, v, acceleration).copy()

    def forward_dynamics(self, q: Array, v: Array, torque: Array) -> Array:
        """Return the acceleration M^-1 (torque - C v - g), shape (n,): equation (3)."""
        return pin.aba(self.model, self._data, q, v, torque).copy()

    def gravity(self, q: Array) -> Array:
        """Return the gravity torque g(q), shape (n,) [N or N m]."""
        return pin.computeGeneralizedGravity(self.model, self._data, q).copy()

    def mechanical_energy(self, q: Array, v: Array) -> float:
        """Return the kinetic plus potential energy [J]."""
        return float(pin.computeMechanicalEnergy(self.model, self._data, q, v))

    def integrate(self, q: Array, step: Array) -> Array:
        """Return the configuration reached from q along the tangent vector `step`, shape (n,)."""
        return pin.integrate(self.model, q, step)

    def tool_rotations(self, q: Array) -> Array:
        """Return the tool orientations in the world, shape (N, 3, 3)."""
        pin.framesForwardKinematics(self.model, self._data, q)
        return np.array([self._data.oMf[tool].rotation for tool in self._tools])

    def external_torque(self, state: TeamState, wrenches: Array) -> Array:
        """Return the joint torque of wrenches on the tools, sum of J_k' w_k, shape (n,).

        Args:
            state: State of the team.
            wrenches: Force and torque on each tool point, world axes, shape (N, 6) [N, N m].
        """
        return np.einsum("kin,ki->n", state.tool_jacobians, wrenches)

    def tool_wrenches(self, state: TeamState, torque: Array) -> Array:
        """Return the smallest tool wrenches that cause a joint torque, shape (N, 6) [N, N m]."""
        return np.array(
            [
                inverse @ torque[part]
                for inverse, part in zip(
                    self._tool_inverses(state.tool_jacobians), self.velocity_slices, strict=True
                )
            ]
        )

    def _compute_tool_inverses(self, jacobians: Array) -> list[Array]:
        """Return the pseudo-inverse of each robot's transposed tool Jacobian, shape (6, n_i)."""
        parts = zip(jacobians, self.velocity_slices, strict=True)
        return [np.linalg.pinv(J[:, part].T) for J, part in parts]

    def index(self, name: str) -> int:
        """Return the index of a robot in the team.

        Raises:
            TeamError: No robot has this name.
        """
        if name not in self.names:
            raise TeamError(f"no robot is named {name!r}; the team has {list(self.names)}")
        return self.names.index(name)


def _join(robots: Sequence[Robot]) -> pin.Model:
    """Join robots into one model; the robot's name prefixes its joints and frames."""
    team = pin.Model()
    team.name = "team"
    for robot in robots:
        part = robot.model.copy()
        for joint in range(1, part.njoints):
            part.names[joint] = f"{robot.name}/{part.names[joint]}"
        for index in range(1, part.nframes):
            frame = part.frames[index]
            frame.name = f"{robot.name}/{frame.name}"
        team = append_model(team, part, robot.base_pose)
    return team
