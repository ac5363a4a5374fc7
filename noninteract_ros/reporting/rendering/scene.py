# SPDX-License-Identifier: Apache-2.0
"""Geometry of a run for rendering: robots, held bodies and reference ghost.

The recording contains the joints of the robots only. Held bodies are drawn at their static
equilibrium in the grasps; accelerated bodies deviate from it by the deflection of the grasps. The
ghost is the configuration of the team in which every subtask is on its reference.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from noninteract_ros.arrays import Array
from noninteract_ros.errors import RecordingError
from noninteract_ros.reporting.recording.recorded import Recorded
from noninteract_ros.reporting.rendering.tool_points import edges_of, tool_points
from noninteract_ros.scenario.shapes import Shape, shapes_of
from noninteract_ros.team.geometry.hulls import Hull
from noninteract_ros.team.team import PRISMATIC

STEP = 1e-6  # [m; rad] of finite differences
ITERATIONS = 12
CLOSE = 1e-4  # [m; rad] tolerance of the ghost
MAX_STEP = 0.2  # [m; rad] of its iterations


@dataclass(frozen=True)
class Snapshot:
    """Configuration at one state of a run.

    Attributes:
        time: Time of the run [s].
        q: Configuration of the plant, shape (nq,).
        ghost: Configuration with all subtasks on their references, shape (nq,); None if there is
            none or it is unknown.
        row: Row of the recorded states.
    """

    time: float
    q: Array
    ghost: Array | None
    row: int


class Scene:
    """Geometry of a run.

    Args:
        recorded: The run.

    Attributes:
        plant: Robots and bodies.
        centre: Middle of the tools' paths and of the bases, shape (3,) [m].
        radius: Radius of the scene about the centre [m].
        flat: True if the team moves in a horizontal plane.
        paths: Tool points over time, shape (m, N, 3) [m], at times `path_times`.
        shapes: Shapes of robots and bodies.
        edges: Pairs of robots related by a subtask.
        states: Rows of finite recorded states.

    Raises:
        RecordingError: No recorded state is finite.
    """

    def __init__(self, recorded: Recorded) -> None:
        self._recorded = recorded
        self.team = recorded.team
        self.plant = recorded.scenario.build_simulation(recorded.team, recorded.stack).plant
        self.states = np.flatnonzero(np.isfinite(recorded.q).all(axis=1))
        if not len(self.states):
            raise RecordingError("no finite joint state to draw")
        self.path_times, self.paths = tool_points(recorded)
        self.edges = edges_of(recorded)
        corners = self._corners()
        low, high = corners.min(axis=0), corners.max(axis=0)
        self.centre = 0.5 * (low + high)
        self.flat = bool(high[2] - low[2] < 0.05 * np.linalg.norm(high - low))
        self.radius = float(np.linalg.norm(corners - self.centre, axis=1).max()) or 1.0
        self.shapes: list[Shape] = shapes_of(recorded.scenario, self.plant, self.radius)
        self._data = self.plant.model.createData()
        self._bodies = self.plant.q0[len(self.team.q0) :]

    def _corners(self) -> Array:
        """Return points that must be visible, shape (m, 3) [m]: bases, joints and tools."""
        points = [self.paths.reshape(-1, 3)]
        data = self.team.model.createData()
        for row in self.states[:: max(1, len(self.states) // 8)]:
            pin.forwardKinematics(self.team.model, data, self._recorded.q[row])
            joints = [data.oMi[joint].translation for joint in self._articulated_joints]
            points.append(np.array(joints).reshape(-1, 3))
        corners = np.concatenate(points)
        return corners[np.isfinite(corners).all(axis=1)]

    @cached_property
    def articulated(self) -> list[bool]:
        """True for robots with joints that are not prismatic, one entry per robot."""
        return [
            any(joint.shortname() not in PRISMATIC for joint in robot.model.joints[1:])
            for robot in self.team.robots
        ]

    @cached_property
    def _articulated_joints(self) -> list[int]:
        """Indices of the joints of articulated robots."""
        names = [
            f"{robot.name}/{joint}"
            for robot, turns in zip(self.team.robots, self.articulated, strict=True)
            for joint in list(robot.model.names)[1:]
            if turns
        ]
        return [self.team.model.getJointId(name) for name in names]

    def snapshot(self, row: int) -> Snapshot:
        """Return the snapshot of a state; call in the order of time."""
        q = self._recorded.q[row]
        if len(self._bodies):
            self._bodies = self._body_equilibrium(q)
        ghost = self._reference_configuration(row)
        return Snapshot(
            float(self._recorded.t[row]),
            np.concatenate((q, self._bodies)),
            None if ghost is None else np.concatenate((ghost, self._bodies)),
            row,
        )

    def _body_equilibrium(self, q: Array) -> Array:
        """Return the static equilibrium of the bodies in their grasps (Newton's method)."""
        plant, n = self.plant, self.team.n
        whole = np.concatenate((q, self._bodies))
        count = plant.model.nv - n
        for _ in range(3):
            force = self._force(whole)
            columns = []
            for number in range(n, n + count):
                step = np.zeros(plant.model.nv)
                step[number] = STEP
                columns.append((self._force(plant.integrate(whole, step)) - force) / STEP)
            solved = np.linalg.lstsq(np.array(columns).T, -force, rcond=1e-6)[0]
            step = np.concatenate((np.zeros(n), solved))
            whole = plant.integrate(whole, step)
            if np.abs(step).max() < CLOSE:
                break
        return whole[len(q) :]

    def _force(self, whole: Array) -> Array:
        """Return the force on the bodies at rest, shape (m,) [N or N m]."""
        plant = self.plant
        couplings = plant.external_loads(whole, np.zeros(plant.model.nv)).coupling_torque
        gravity = pin.computeGeneralizedGravity(plant.model, self._data, whole)
        return (couplings - gravity)[self.team.n :]

    def _reference_configuration(self, row: int) -> Array | None:
        """Return the configuration on all desired values (Newton's method), or None."""
        desired = self._desired_at(row)
        if desired is None:
            return None
        team, stack = self.team, self._recorded.stack
        q, still = self._recorded.q[row], np.zeros(team.n)
        for _ in range(ITERATIONS):
            task = stack.evaluate(team.state(q, still))
            e = stack.difference(task.x, desired)
            if np.abs(e).max() < CLOSE:
                return q
            step = -np.linalg.lstsq(task.J, e, rcond=1e-3)[0]
            q = team.integrate(q, step * min(1.0, MAX_STEP / (np.abs(step).max() or 1.0)))
        return None

    def _desired_at(self, row: int) -> Array | None:
        """Return desired values at a state, shape (size,); None if not recorded."""
        if self._desired is None:
            return None
        t, values = self._desired
        place = int(np.searchsorted(t, self._recorded.t[row] + 1e-9)) - 1
        desired = values[max(place, 0)]
        return desired if np.isfinite(desired).all() else None

    @cached_property
    def _desired(self) -> tuple[Array, Array] | None:
        """Times (m,) and desired values (m, size) of all subtasks; None if any is missing."""
        names = self._recorded.stack.names
        try:
            motions = [self._recorded.motion(f"{name}/desired", name) for name in names]
        except RecordingError:
            return None
        if len({len(motion.t) for motion in motions}) != 1 or not len(motions[0].t):
            return None
        return motions[0].t, np.hstack([motion.position for motion in motions])

    def hulls(self, q: Array) -> list[tuple[int, Hull]]:
        """Return owner and world geometry of every shape at a configuration of the plant."""
        pin.forwardKinematics(self.plant.model, self._data, q)
        return [
            (item.owner, item.hull.transformed(self._data.oMi[item.joint])) for item in self.shapes
        ]

    def tools(self, q: Array) -> list[pin.SE3]:
        """Return the tool frames in the world at a configuration of the plant."""
        state = self.team.state(q[: len(self.team.q0)], np.zeros(self.team.n))
        pairs = zip(state.tool_rotations, state.tool_positions, strict=True)
        return [pin.SE3(rotation, position) for rotation, position in pairs]

    def pushes(self, snapshot: Snapshot) -> list[tuple[Array, Array]]:
        """Return point [m] and force [N] of each active scheduled push, in the world."""
        found = []
        pin.framesForwardKinematics(self.plant.model, self._data, snapshot.q)
        for push in self._recorded.scenario.pushes.values():
            force = push.wrench(snapshot.time)[:3]
            if force.any():
                frame = self.plant.model.getFrameId(push.frame_name(self.team))
                found.append((self._data.oMf[frame].translation.copy(), force))
        return found
