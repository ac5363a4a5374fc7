# SPDX-License-Identifier: Apache-2.0
"""Elbow swivel angle: rotation of an arm's elbow about the line from shoulder to wrist.

With d from shoulder to elbow, a from shoulder to wrist, u = a / |a| and a reference direction r,
it is the angle about u from the half-plane of r to that of d:

    psi = atan2(|a| d.(a x r), (a x d).(a x r))

    dpsi/dt = g_d . dd/dt + g_a . da/dt,    g_d = (u x d) / |u x d|^2
    g_a = (-(u.d) g_d + (u.r) g_r) / |a|,   g_r = (u x r) / |u x r|^2

g_d follows from the circular motion of the elbow about the line at the distance |u x d|, and g_a
from the invariance under a common rotation of d, a and r. The angle is undefined for a straight
arm and for a line along r.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from noninteract_ros.arrays import Array
from noninteract_ros.errors import ScenarioError, one_of
from noninteract_ros.schema import join, key
from noninteract_ros.subtasks.kinds.edges import NO_SUBTASKS
from noninteract_ros.subtasks.subtask import Subtask, SubtaskState
from noninteract_ros.team.robot import Robot
from noninteract_ros.team.team import Team, TeamState

TINY = 1e-12  # relative to lengths; keeps quotients finite where the angle is undefined


@dataclass(frozen=True)
class ElbowAngle:
    """Configuration block of the elbow angle subtask.

    The elements are the robots; messages carry an angle [rad] as the x of a translation. Angles
    that differ by full turns are equal.
    """

    kind: str = key("Kind of subtask", choices=("elbow_angle",))
    shoulder: tuple[str, ...] = key("Frame at the shoulder: one for all robots or one per robot")
    elbow: tuple[str, ...] = key("Frame at the elbow: one for all robots or one per robot")
    wrist: tuple[str, ...] = key("Frame at the wrist: one for all robots or one per robot")
    robots: tuple[str, ...] = key("Robots with a controlled elbow; by default all", ())
    reference: tuple[float, ...] = key(
        "Direction in the world at which the angle is zero; must not become parallel to the line"
        " from shoulder to wrist",
        (0.0, 0.0, 1.0),
    )

    def build(self, name: str, team: Team, others: Mapping[str, Subtask] = NO_SUBTASKS) -> Subtask:
        """Return the subtask for a team.

        Raises:
            ScenarioError: A robot or a frame does not exist, or the reference is zero.
        """
        names = self.robots or team.names
        for robot in names:
            if robot not in team.names or names.count(robot) > 1:
                allowed = f"each once: {one_of(team.names, robot)}"
                raise ScenarioError(join(name, "robots"), repr(robot), allowed)
        reference = np.array(self.reference)
        if reference.shape != (3,) or not np.linalg.norm(reference) > 0.0:
            path = join(name, "reference")
            raise ScenarioError(path, list(self.reference), "x y z, not all zero")
        chosen = [team.robots[team.index(robot)] for robot in names]
        shoulders, elbows, wrists = (
            _frame_numbers(join(name, point), getattr(self, point), chosen)
            for point in ("shoulder", "elbow", "wrist")
        )
        frames = zip(shoulders, elbows, wrists, strict=True)
        unit = reference / np.linalg.norm(reference)
        arms = [_Arm(team, robot, own, unit) for robot, own in zip(chosen, frames, strict=True)]
        return ElbowAngles(name, tuple(names), arms)


def _frame_numbers(path: str, given: tuple[str, ...], robots: Sequence[Robot]) -> list[int]:
    if len(given) not in (1, len(robots)):
        raise ScenarioError(path, list(given), f"1 name, or {len(robots)}: one per robot")
    numbers = []
    for robot, frame in zip(robots, given * (len(robots) // len(given)), strict=True):
        if not robot.model.existFrame(frame):
            known = [item.name for item in robot.model.frames][1:]
            raise ScenarioError(path, f"{frame!r} for {robot.name}", one_of(known, frame))
        numbers.append(robot.model.getFrameId(frame))
    return numbers


class Normal(NamedTuple):
    """Normal n = u x vector of a moving axis u, divided by |n|^2, with its rate.

    Attributes:
        value: n / |n|^2, shape (3,).
        rate: Time derivative of the value, shape (3,).
        distance: |n|.
    """

    value: Array
    rate: Array
    distance: float


def _normal(u: Array, u_rate: Array, vector: Array, vector_rate: Array) -> Normal:
    n = np.cross(u, vector)
    n_rate = np.cross(u_rate, vector) + np.cross(u, vector_rate)
    square = max(float(n @ n), TINY * float(vector @ vector))
    value = n / square
    return Normal(value, (n_rate - 2.0 * (n @ n_rate) * value) / square, float(np.sqrt(square)))


class _Arm:
    """Elbow angle of one robot, in axes of its base.

    Args:
        team: Team of the robot.
        robot: Robot of the arm.
        frames: Indices of the frames at shoulder, elbow and wrist.
        reference: Unit vector in the world, shape (3,).
    """

    def __init__(
        self, team: Team, robot: Robot, frames: tuple[int, ...], reference: Array
    ) -> None:
        index = team.index(robot.name)
        start = sum(other.model.nq for other in team.robots[:index])
        self._in_q = slice(start, start + robot.model.nq)
        self.in_v = team.velocity_slices[index]
        self._model, self._data = robot.model, robot.model.createData()
        self._frames = frames
        self._reference = robot.base_pose.rotation.T @ reference

    def lines(self, q: Array) -> tuple[Array, Array]:
        """Return the vectors shoulder to elbow and shoulder to wrist, shape (3,) each [m]."""
        pin.forwardKinematics(self._model, self._data, q[self._in_q])
        shoulder, elbow, wrist = (
            pin.updateFramePlacement(self._model, self._data, frame).translation
            for frame in self._frames
        )
        return elbow - shoulder, wrist - shoulder

    def singularity_distance(self, q: Array) -> float:
        """Return the smaller sine of the line's angles to the upper arm and to the reference."""
        d, a = self.lines(q)
        length = float(np.linalg.norm(a))
        if length <= TINY * float(np.linalg.norm(d)):
            return 0.0
        bent = np.linalg.norm(np.cross(a, d)) / np.linalg.norm(d)
        return float(min(bent, np.linalg.norm(np.cross(a, self._reference))) / length)

    def evaluate(self, q: Array, v: Array) -> tuple[float, Array, Array]:
        """Return angle, Jacobian and Jacobian rate, with respect to the robot's own joints."""
        v = v[self.in_v]
        pin.computeJointJacobiansTimeVariation(self._model, self._data, q[self._in_q], v)
        d, a = self.lines(q)
        (D, A), (D_rate, A_rate) = self._jacobians()
        r, length = self._reference, max(float(np.linalg.norm(a)), TINY)
        u, d_rate, a_rate = a / length, D @ v, A @ v
        stretch = u @ a_rate
        u_rate = (a_rate - stretch * u) / length
        swivel, offset = _normal(u, u_rate, d, d_rate), _normal(u, u_rate, r, np.zeros(3))
        along_d, along_r = u @ d, u @ r
        g_d = swivel.value
        g_a = (along_r * offset.value - along_d * g_d) / length
        g_a_rate = (
            (u_rate @ r) * offset.value
            + along_r * offset.rate
            - (u_rate @ d + u @ d_rate) * g_d
            - along_d * swivel.rate
            - stretch * g_a
        ) / length
        angle = np.arctan2(length * (d @ np.cross(a, r)), np.cross(a, d) @ np.cross(a, r))
        J_rate = swivel.rate @ D + g_d @ D_rate + g_a_rate @ A + g_a @ A_rate
        return float(angle), g_d @ D + g_a @ A, J_rate

    def _jacobians(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Return the Jacobians of both lines, and their rates, shape (3, nv) each."""
        axes = pin.LOCAL_WORLD_ALIGNED
        found = []
        for of in (pin.getFrameJacobian, pin.getFrameJacobianTimeVariation):
            shoulder, elbow, wrist = (
                of(self._model, self._data, frame, axes)[:3] for frame in self._frames
            )
            found.append((elbow - shoulder, wrist - shoulder))
        return found[0], found[1]


class ElbowAngles(Subtask):
    """Elbow angles of some robots [rad], each in (-pi, pi].

    Args:
        name: Name of the subtask.
        robots: Names of the robots, which are the elements.
        arms: Elbow angle of each robot.
    """

    axes = ("x",)
    angles = True

    def __init__(self, name: str, robots: tuple[str, ...], arms: Sequence[_Arm]) -> None:
        self.name, self.elements, self._arms = name, robots, tuple(arms)

    def evaluate(self, state: TeamState) -> SubtaskState:
        """Return value and differentials; bounded, but meaningless, at an undefined angle."""
        x, (J, J_rate) = np.empty(self.dim), np.zeros((2, self.dim, len(state.v)))
        for i, arm in enumerate(self._arms):
            x[i], J[i, arm.in_v], J_rate[i, arm.in_v] = arm.evaluate(state.q, state.v)
        return SubtaskState(x, J, J_rate)

    def singularity_distance(self, state: TeamState) -> float:
        """Return the least distance of the arms from an undefined angle."""
        return min(arm.singularity_distance(state.q) for arm in self._arms)
