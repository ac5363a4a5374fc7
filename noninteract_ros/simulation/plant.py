# SPDX-License-Identifier: Apache-2.0
"""Team and passive bodies as one Pinocchio model, with the couplings between them."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from noninteract_ros.arrays import Array
from noninteract_ros.simulation.contact import Coupling, Effect, FrameMotion
from noninteract_ros.team.joining import append_model
from noninteract_ros.team.team import Team

AXES = pin.LOCAL_WORLD_ALIGNED


class Plant:
    """Everything that moves; the team's coordinates come first.

    Args:
        team: The robots.
        bodies: Models of passive bodies, each a tree of its own; joints and frames have names
            that nothing else has.
        couplings: Passive couplings between frames of the team and of the bodies.

    Attributes:
        model: The joint model.
        q0: Initial configuration: the team's own, the bodies' neutral one.
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
        self._frames = [[self._frame(name) for name in item.frames] for item in self.couplings]

    def _frame(self, name: str) -> int:
        if not self.model.existFrame(name):
            raise KeyError(f"the plant has no frame {name!r}")
        return int(self.model.getFrameId(name))

    def integrate(self, q: Array, step: Array) -> Array:
        """Configuration reached from q along a tangent vector, shape (nv,)."""
        return pin.integrate(self.model, q, step)

    def chart_velocity(self, q_0: Array, q: Array, v: Array) -> Array:
        """Rate of the tangent vector from q_0 to q, shape (nv,); v itself on flat joints."""
        if not self._curved:
            return v
        return pin.dDifference(self.model, q_0, q, pin.ARG1) @ v

    def effects(self, q: Array, v: Array) -> list[Effect]:
        """What each coupling does at a state of the plant."""
        if not self.couplings:
            return []
        pin.forwardKinematics(self.model, self._data, q, v)
        return [
            coupling.effect(tuple(self._motion(frame) for frame in frames))
            for coupling, frames in zip(self.couplings, self._frames, strict=True)
        ]

    def _motion(self, frame: int) -> FrameMotion:
        placement = pin.updateFramePlacement(self.model, self._data, frame)
        velocity = pin.getFrameVelocity(self.model, self._data, frame, AXES)
        return FrameMotion(
            placement.translation.copy(),
            placement.rotation.copy(),
            velocity.linear.copy(),
            velocity.angular.copy(),
        )

    def coupling_torque(self, q: Array, effects: Sequence[Effect]) -> Array:
        """Generalised force of all couplings, shape (nv,)."""
        total = np.zeros(self.model.nv)
        if effects:
            pin.computeJointJacobians(self.model, self._data, q)
        for effect, frames in zip(effects, self._frames, strict=True):
            for wrench, frame in zip(effect.wrenches, frames, strict=True):
                if wrench.any():
                    J = pin.getFrameJacobian(self.model, self._data, frame, AXES)
                    total += J.T @ wrench
        return total

    def tool_wrenches(self, effects: Sequence[Effect]) -> Array:
        """Sum of the couplings' wrenches on each tool, world axes, shape (N, 6) [N, N m]."""
        wrenches = np.zeros((len(self.team.robots), 6))
        tools = [f"{robot.name}/{robot.tool_frame}" for robot in self.team.robots]
        for coupling, effect in zip(self.couplings, effects, strict=True):
            for name, wrench in zip(coupling.frames, effect.wrenches, strict=True):
                if name in tools:
                    wrenches[tools.index(name)] += wrench
        return wrenches

    def acceleration(self, q: Array, v: Array, torque: Array) -> Array:
        """Acceleration under a generalised force, shape (nv,)."""
        return pin.aba(self.model, self._data, q, v, torque).copy()

    def mechanical_energy(self, q: Array, v: Array) -> float:
        """Kinetic energy plus potential energy in gravity [J]."""
        return float(pin.computeMechanicalEnergy(self.model, self._data, q, v))
