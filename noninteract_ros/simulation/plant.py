# SPDX-License-Identifier: Apache-2.0
"""Team and passive bodies as one Pinocchio model, with the couplings between them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from noninteract_ros.arrays import Array
from noninteract_ros.simulation.contact import Coupling, Effect, FrameMotion
from noninteract_ros.simulation.push import Push
from noninteract_ros.team.joined_model import append_model
from noninteract_ros.team.team import Team

AXES = pin.LOCAL_WORLD_ALIGNED


@dataclass(frozen=True, slots=True)
class ExternalLoads:
    """External loads on a plant: couplings and pushes, without controls, gravity and friction.

    Attributes:
        coupling_torque: Generalised force of all couplings, shape (nv,) [N or N m].
        push_torque: Generalised force of all pushes, shape (nv,) [N or N m].
        effects: Effect of each coupling.
    """

    coupling_torque: Array
    push_torque: Array
    effects: tuple[Effect, ...]


class Plant:
    """Joint model of the team and all passive bodies; the team's coordinates come first.

    Args:
        team: The robots.
        bodies: Models of passive bodies, each a tree of its own; names of joints and frames are
            unique.
        couplings: Passive couplings between frames of the team and of the bodies.

    Attributes:
        model: The joint model.
        q0: Initial configuration: that of the team, and the neutral one of the bodies.
        friction: Viscous friction of all joints, shape (nv,) [N s/m or N m s/rad].
    """

    def __init__(
        self, team: Team, bodies: Sequence[pin.Model] = (), couplings: Sequence[Coupling] = ()
    ) -> None:
        self.team = team
        self.couplings = tuple(couplings)
        model = team.model
        for body in bodies:
            model = append_model(model, body, pin.SE3.Identity())
        model.gravity = team.model.gravity
        self.model = model
        self.friction = model.damping.copy()
        self._data = model.createData()
        self.q0 = pin.neutral(model)
        self.q0[: len(team.q0)] = team.q0
        # On joints whose tangent space commutes, Runge-Kutta needs no correction.
        self._curved = any(joint.nv > 1 for joint in model.joints[1:])
        self._numbers = {frame.name: number for number, frame in enumerate(model.frames)}
        self._frames = [[self._frame(name) for name in item.frames] for item in self.couplings]
        self._tools = [f"{robot.name}/{robot.tool_frame}" for robot in team.robots]
        first = team.model.njoints
        names = [model.names[joint] for joint in range(first, model.njoints)]
        self._bodies = {name.split("/")[0]: first + i for i, name in enumerate(names)}

    def _frame(self, name: str) -> int:
        return self._numbers[name]

    def integrate(self, q: Array, step: Array) -> Array:
        """Return the configuration reached from q along a tangent vector, shape (nv,)."""
        return pin.integrate(self.model, q, step)

    @property
    def body_names(self) -> tuple[str, ...]:
        """Names of the passive bodies."""
        return tuple(self._bodies)

    def body_poses(self, q: Array) -> dict[str, Array]:
        """Return the pose of each passive body, by name.

        The pose of a door is that of its hinge.

        Returns:
            Poses x, y, z, quaternion x, y, z, w, shape (7,) each.
        """
        pin.forwardKinematics(self.model, self._data, q)
        return {
            name: pin.SE3ToXYZQUAT(self._data.oMi[joint]) for name, joint in self._bodies.items()
        }

    def chart_velocity(self, q_0: Array, q: Array, v: Array) -> Array:
        """Return the rate of the tangent vector from q_0 to q, shape (nv,); v on flat joints."""
        if not self._curved:
            return v
        return pin.dDifference(self.model, q_0, q, pin.ARG1) @ v

    def external_loads(self, q: Array, v: Array, pushes: Sequence[Push] = ()) -> ExternalLoads:
        """Compute the loads of couplings and pushes at a state of the plant."""
        zero = np.zeros(self.model.nv)
        if not self.couplings and not pushes:
            return ExternalLoads(zero, zero, ())
        pin.computeJointJacobians(self.model, self._data, q)
        coupling_torque, effects = zero.copy(), []
        for coupling, frames in zip(self.couplings, self._frames, strict=True):
            jacobians = [self._jacobian(frame) for frame in frames]
            motions = [self._motion(*pair, v) for pair in zip(frames, jacobians, strict=True)]
            effect = coupling.effect(tuple(motions))
            effects.append(effect)
            for J, wrench in zip(jacobians, effect.wrenches, strict=True):
                coupling_torque += J.T @ wrench
        push_torque = zero.copy()
        for push in pushes:
            J = self._jacobian(self._frame(push.frame))
            push_torque += J.T @ self._in_world_axes(push)
        return ExternalLoads(coupling_torque, push_torque, tuple(effects))

    def _jacobian(self, frame: int) -> Array:
        return pin.getFrameJacobian(self.model, self._data, frame, AXES).reshape(6, -1)

    def _motion(self, frame: int, J: Array, v: Array) -> FrameMotion:
        placement = pin.updateFramePlacement(self.model, self._data, frame)
        twist = J @ v
        return FrameMotion(placement.translation, placement.rotation, twist[:3], twist[3:])

    def _in_world_axes(self, push: Push) -> Array:
        if not push.in_frame_axes:
            return push.wrench
        R = pin.updateFramePlacement(self.model, self._data, self._frame(push.frame)).rotation
        return np.concatenate([R @ push.wrench[:3], R @ push.wrench[3:]])

    def tool_wrenches(self, q: Array, v: Array, pushes: Sequence[Push] = ()) -> Array:
        """Return the wrench of couplings and pushes on each tool, world axes, (N, 6) [N, N m]."""
        wrenches = np.zeros((len(self.team.robots), 6))
        effects = self.external_loads(q, v, pushes).effects
        acting = [(push.frame, self._in_world_axes(push)) for push in pushes]
        for coupling, effect in zip(self.couplings, effects, strict=True):
            acting += zip(coupling.frames, effect.wrenches, strict=True)
        for name, wrench in acting:
            if name in self._tools:
                wrenches[self._tools.index(name)] += wrench
        return wrenches

    def acceleration(self, q: Array, v: Array, torque: Array) -> Array:
        """Return the acceleration under a generalised force, shape (nv,)."""
        return pin.aba(self.model, self._data, q, v, torque).copy()

    def mechanical_energy(self, q: Array, v: Array) -> float:
        """Return kinetic energy plus potential energy in gravity [J]."""
        return float(pin.computeMechanicalEnergy(self.model, self._data, q, v))
