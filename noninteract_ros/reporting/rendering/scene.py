# SPDX-License-Identifier: Apache-2.0
"""Where everything of a run was at one moment, so that it can be drawn.

The recording holds the robots' joints. Bodies that they hold are put where they would rest in
their grips, given the tools; a body that is accelerated is off that as its grips give way.
The ghost of the team is where every subtask would be on its reference.
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

STEP = 1e-6  # [m; rad] of differences
ITERATIONS = 12
CLOSE = 1e-4  # [m; rad] how near its references the ghost of a team has to come
LONGEST_STEP = 0.2  # [m; rad] on the way there


@dataclass(frozen=True)
class Snapshot:
    """One moment of a run.

    Attributes:
        time: Of the run [s].
        q: Configuration of the plant, shape (nq,).
        ghost: Configuration in which all subtasks are on their references, shape (nq,); None where
            there is none or nobody knows it.
        row: Row of the recorded states.
    """

    time: float
    q: Array
    ghost: Array | None
    row: int


class Scene:
    """Everything that can be seen in a run.

    Args:
        recorded: The run.

    Attributes:
        plant: Robots and bodies.
        centre: Middle of the tools' paths and of the bases, shape (3,) [m].
        radius: Of all that is seen about it [m].
        flat: Whether the team moves in a horizontal plane.
        paths: Tool points over time, shape (m, N, 3) [m], at times `path_times`.
        shapes: What robots and bodies look like.
        edges: Pairs of robots that a subtask relates.
        states: Rows of the recorded states that are numbers.

    Raises:
        RecordingError: None is.
    """

    def __init__(self, recorded: Recorded) -> None:
        self._recorded = recorded
        self.team = recorded.team
        self.plant = recorded.scenario.build_simulation(recorded.team, recorded.stack).plant
        self.states = np.flatnonzero(np.isfinite(recorded.q).all(axis=1))
        if not len(self.states):
            raise RecordingError("no joint state is a number, so that there is nothing to draw")
        self.path_times, self.paths = tool_points(recorded)
        self.edges = edges_of(recorded)
        seen = self._corners()
        low, high = seen.min(axis=0), seen.max(axis=0)
        self.centre = 0.5 * (low + high)
        self.flat = bool(high[2] - low[2] < 0.05 * np.linalg.norm(high - low))
        self.radius = float(np.linalg.norm(seen - self.centre, axis=1).max()) or 1.0
        self.shapes: list[Shape] = shapes_of(recorded.scenario, self.plant, self.radius)
        self._data = self.plant.model.createData()
        self._bodies = self.plant.q0[len(self.team.q0) :]

    def _corners(self) -> Array:
        """Points that must be in the picture, shape (m, 3) [m]: bases, joints and tools."""
        points = [self.paths.reshape(-1, 3)]
        data = self.team.model.createData()
        for row in self.states[:: max(1, len(self.states) // 8)]:
            pin.forwardKinematics(self.team.model, data, self._recorded.q[row])
            joints = [data.oMi[joint].translation for joint in self._linked]
            points.append(np.array(joints).reshape(-1, 3))
        corners = np.concatenate(points)
        return corners[np.isfinite(corners).all(axis=1)]

    @cached_property
    def turning(self) -> list[bool]:
        """Of each robot, whether it is more than a mass that slides along axes."""
        return [
            any(joint.shortname() not in PRISMATIC for joint in robot.model.joints[1:])
            for robot in self.team.robots
        ]

    @cached_property
    def _linked(self) -> list[int]:
        """Joints whose place says something: those of robots that turn."""
        names = [
            f"{robot.name}/{joint}"
            for robot, turns in zip(self.team.robots, self.turning, strict=True)
            for joint in list(robot.model.names)[1:]
            if turns
        ]
        return [self.team.model.getJointId(name) for name in names]

    def moment(self, row: int) -> Snapshot:
        """Where everything was at a state; ask in the order of time."""
        q = self._recorded.q[row]
        if len(self._bodies):
            self._bodies = self._resting(q)
        ghost = self._on_references(row)
        return Snapshot(
            float(self._recorded.t[row]),
            np.concatenate((q, self._bodies)),
            None if ghost is None else np.concatenate((ghost, self._bodies)),
            row,
        )

    def _resting(self, q: Array) -> Array:
        """Configuration of the bodies in which grips and gravity balance (Newton's method)."""
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
        """What acts on the bodies at rest, shape (m,) [N or N m]."""
        plant = self.plant
        couplings = plant.external_loads(whole, np.zeros(plant.model.nv)).coupling_torque
        gravity = pin.computeGeneralizedGravity(plant.model, self._data, whole)
        return (couplings - gravity)[self.team.n :]

    def _on_references(self, row: int) -> Array | None:
        """Configuration on all desired values at a state (Newton's method), or None."""
        wanted = self._wanted(row)
        if wanted is None:
            return None
        team, stack = self.team, self._recorded.stack
        q, still = self._recorded.q[row], np.zeros(team.n)
        for _ in range(ITERATIONS):
            task = stack.evaluate(team.state(q, still))
            e = stack.difference(task.x, wanted)
            if np.abs(e).max() < CLOSE:
                return q
            step = -np.linalg.lstsq(task.J, e, rcond=1e-3)[0]
            q = team.integrate(q, step * min(1.0, LONGEST_STEP / (np.abs(step).max() or 1.0)))
        return None

    def _wanted(self, row: int) -> Array | None:
        """Desired values of all subtasks at a state, shape (size,); None where not recorded."""
        if self._desired is None:
            return None
        t, values = self._desired
        place = int(np.searchsorted(t, self._recorded.t[row] + 1e-9)) - 1
        wanted = values[max(place, 0)]
        return wanted if np.isfinite(wanted).all() else None

    @cached_property
    def _desired(self) -> tuple[Array, Array] | None:
        """Times and desired values (m, size) of all subtasks; None where one is missing."""
        names = self._recorded.stack.names
        try:
            motions = [self._recorded.motion(f"{name}/desired", name) for name in names]
        except RecordingError:
            return None
        if len({len(motion.t) for motion in motions}) != 1 or not len(motions[0].t):
            return None
        return motions[0].t, np.hstack([motion.position for motion in motions])

    def hulls(self, q: Array) -> list[tuple[int, Hull]]:
        """Owner and body in the world of every shape, for a configuration of the plant."""
        pin.forwardKinematics(self.plant.model, self._data, q)
        return [
            (item.owner, item.hull.transformed(self._data.oMi[item.joint])) for item in self.shapes
        ]

    def tools(self, q: Array) -> list[pin.SE3]:
        """Tool frames in the world, for a configuration of the plant."""
        state = self.team.state(q[: len(self.team.q0)], np.zeros(self.team.n))
        pairs = zip(state.tool_rotations, state.tool_positions, strict=True)
        return [pin.SE3(rotation, position) for rotation, position in pairs]

    def pushes(self, moment: Snapshot) -> list[tuple[Array, Array]]:
        """Point and force of each scheduled push that acts, in the world [m, N]."""
        found = []
        pin.framesForwardKinematics(self.plant.model, self._data, moment.q)
        for push in self._recorded.scenario.pushes.values():
            force = push.wrench(moment.time)[:3]
            if force.any():
                frame = self.plant.model.getFrameId(push.frame_name(self.team))
                found.append((self._data.oMf[frame].translation.copy(), force))
        return found
