# SPDX-License-Identifier: Apache-2.0
"""A recorded run with its scenario, as arrays in the coordinates of the law."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.control.references.subtask_input import AUTHORITIES
from noninteract_ros.errors import RecordingError, ScenarioError
from noninteract_ros.reporting.recording.run import Run
from noninteract_ros.reporting.recording.series import JointSeries, TrajectorySeries
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.blocks import description_topics
from noninteract_ros.scenario.files import parameters_of
from noninteract_ros.scenario.yaml_text import YamlTextError, parse_yaml
from noninteract_ros.subtasks.subtask import Subtask
from noninteract_ros.team.models.urdf_robot import TOPIC
from noninteract_ros.team.robot import AXES

DESCRIPTION = "robot_description"

INTERVENTIONS = "interventions"
FRICTION = "joint friction is unknown to the law and not measured at the tools"


@dataclass(frozen=True)
class RecordedMotion:
    """Motion of one subtask over time.

    Attributes:
        t: Time of the run, shape (n,) [s].
        position: Values with quaternions of rotating elements, shape (n, size) [m; rad].
        velocity: Velocities, shape (n, p) [m/s; rad/s].
        acceleration: Accelerations, shape (n, p) [m/s^2; rad/s^2]; NaN where not published.
    """

    t: Array
    position: Array
    velocity: Array
    acceleration: Array


@dataclass(frozen=True)
class Tracking:
    """Actual and desired motion of one subtask at the same times.

    Attributes:
        t: Time of the run, shape (n,) [s].
        actual: Actual motion.
        desired: Desired motion.
    """

    t: Array
    actual: RecordedMotion
    desired: RecordedMotion


class Recorded:
    """A recorded run in the order of the team's joints and the subtasks' axes.

    The time of the run is simulated time in lockstep; in wall time it starts at the first state.

    Args:
        run: The recording.

    Attributes:
        scenario: Scenario of the recording.
        team: The robots.
        stack: Their subtasks.
        ticks: Tick number of each state, shape (m,).
        t: Time of each state, shape (m,) [s].
        q: Configurations, shape (m, nq).
        v: Velocities, shape (m, n).
        torque: Torques held until each state, shape (m, n) [N or N m].

    Raises:
        RecordingError: The scenario is missing or invalid, or joint states are missing.
    """

    def __init__(self, run: Run) -> None:
        self.run = run
        self.scenario = scenario_of(run)
        self.team = self.scenario.build_team()
        self.stack = self.scenario.build_stack(self.team)
        self.states = run.joints("joint_states")
        if len(self.states.stamps) < 2:
            raise RecordingError(f"{run.path}: fewer than 2 joint states")
        general = self.scenario.general
        self.rate, self.lockstep = general.rate, general.lockstep
        self._origin = 0.0 if self.lockstep else float(self.states.stamps[0])
        self.t = self.states.stamps - self._origin
        self.ticks = np.round(self.t * self.rate).astype(np.int64)
        columns = self._columns(self.states)
        positions = self.states.position[:, columns]
        self.q = np.array([self.team.configuration_from_joints(row) for row in positions])
        self.v = self.states.velocity[:, columns]
        self.torque = self.states.effort[:, columns]

    def _columns(self, states: JointSeries) -> list[int]:
        missing = [name for name in self.team.joint_names if name not in states.names]
        if missing:
            raise RecordingError(f"{self.run.path}: joint_states lacks {', '.join(missing)}")
        return [states.names.index(name) for name in self.team.joint_names]

    @cached_property
    def constant(self) -> bool:
        """True if all inertias and Jacobians are constant: positions of point masses."""
        continuous = len(self.team.q0) > self.team.n  # Continuous joints have two coordinates.
        if continuous or any(task.rotates for task in self.stack.subtasks):
            return False
        step, velocity = np.random.default_rng(0).uniform(-0.5, 0.5, (2, self.team.n))
        here = self.team.state(self.team.q0, np.zeros(self.team.n))
        there = self.team.state(self.team.integrate(self.team.q0, step), velocity)
        J, moved = (self.stack.evaluate(state) for state in (here, there))
        same = np.allclose(here.M, there.M) and np.allclose(J.J, moved.J)
        return bool(same and not there.C.any() and not moved.J_rate.any())

    @cached_property
    def steps(self) -> Array:
        """Tangent vectors from each state to the next, shape (m - 1, n)."""
        if self.q.shape[1] == self.team.n:
            return np.diff(self.q, axis=0)
        return np.array([self.team.difference(*pair) for pair in pairwise(self.q)])

    @cached_property
    def values(self) -> tuple[Array, Array]:
        """Subtask values (m, size) and velocities (m, n) at each state."""
        return self.task_values(self.q, self.v)

    def task_values(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return subtask values and velocities of states q (m, nq) and v (m, n)."""
        if self.constant:
            q0 = self.team.q0
            task = self.stack.evaluate(self.team.state(q0, np.zeros(self.team.n)))
            return task.x + (q - q0) @ task.J.T, v @ task.J.T
        x, x_rate = np.empty((len(q), self.value_size)), np.empty((len(q), self.team.n))
        for i, (q_i, v_i) in enumerate(zip(q, v, strict=True)):
            task = self.stack.evaluate(self.team.state(q_i, v_i))
            x[i], x_rate[i] = task.x, task.J @ v_i
        return x, x_rate

    @property
    def value_size(self) -> int:
        """Size of the values of all subtasks."""
        return self.stack.value_slices[-1].stop

    def part(self, name: str) -> slice:
        """Return the coordinates of a subtask in the stacked vectors."""
        return self.stack.slices[self.stack.names.index(name)]

    def task(self, name: str) -> Subtask:
        """Return a subtask by name."""
        return self.stack.subtasks[self.stack.names.index(name)]

    def has(self, topic: str) -> bool:
        """Return True if a topic whose name ends in `topic` was recorded."""
        return any(name.endswith(f"/{topic}") for name in self.run.topics)

    def team_topic(self, name: str) -> str:
        """Return the full name of a topic in the team's own namespace."""
        ends = (topic for topic in self.run.topics if topic.endswith("/joint_states"))
        states = min(ends, key=len)  # Robots may publish theirs in deeper namespaces.
        return states.removesuffix("joint_states") + name

    def motion(self, topic: str, subtask: str) -> RecordedMotion:
        """Return the state, desired motion or references of a subtask.

        Raises:
            RecordingError: The topic is missing or of another type.
        """
        series = self.run.trajectory(topic)
        task = self.task(subtask)
        pairs = (
            (series.translation, series.quaternion),
            (series.linear_velocity, series.angular_velocity),
            (series.linear_acceleration, series.angular_acceleration),
        )
        t = series.stamps - self._origin
        return RecordedMotion(t, *(_coordinates(task, series, *pair) for pair in pairs))

    def tracking(self, subtask: str) -> Tracking:
        """Return actual and desired motion of a subtask at their common times.

        Raises:
            RecordingError: A topic is missing or of another type.
        """
        actual = self.motion(f"{subtask}/state", subtask)
        desired = self.motion(f"{subtask}/desired", subtask)
        rows, others = common_times(actual.t, desired.t)
        return Tracking(actual.t[rows], select(actual, rows), select(desired, others))

    def since_start(self, stamps: Array) -> Array:
        """Convert stamps to the time of the run [s]."""
        return stamps - self._origin

    def reference_topic(self, subtask: str) -> str | None:
        """Return the reference topic of the leading source; None if it was not recorded."""
        authority = self.scenario.subtasks[subtask].input.authority
        topic = f"{subtask}/{authority}/reference"
        return topic if self.has(topic) else None

    def energy_entry(self, subtask: str, label: str) -> tuple[Array, Array] | None:
        """Return times [s] and values of one entry of `SUBTASK/energy`, shape (n,) each.

        None if the topic or the entry was not recorded.
        """
        if not self.has(topic := f"{subtask}/energy"):
            return None
        series = self.run.labelled(topic)
        if label not in series.labels:
            return None
        return self.since_start(series.stamps), series[label]

    def interventions(self, end: float = np.inf) -> int:
        """Return the number of ticks up to a time [s] whose torque was not the law's own."""
        if (entry := self.energy_entry(self.stack.names[0], INTERVENTIONS)) is None:
            return 0
        t, counts = entry
        return int(counts[t <= end].max(initial=0.0))

    def start(self, subtask: str) -> float | None:
        """Return the time at which a subtask is first led [s]; None if it never is."""
        if (entry := self.energy_entry(subtask, "leader")) is not None:
            t, leader = entry
            led = t[leader != AUTHORITIES.index("hold")]
            return float(led[0]) if len(led) else None
        topic = self.reference_topic(subtask)
        if topic is None:
            return None
        t = self.motion(topic, subtask).t
        return float(max(t.min(), self.t[0])) if len(t) else None


def scenario_of(run: Run) -> Scenario:
    """Build the scenario of a recording.

    Raises:
        RecordingError: The scenario is missing or invalid.
    """
    if run.scenario is None:
        raise RecordingError(f"{run.path}: no scenario: the run cannot be analysed")
    try:
        values = parameters_of(parse_yaml(run.scenario))
        return Scenario.from_dict(_described(run, values))
    except (ScenarioError, YamlTextError) as error:
        reason = " ".join(str(error).split())
        raise RecordingError(f"{run.path}: invalid scenario: {reason}") from error


def _described(run: Run, values: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the scenario with the robot descriptions of the recording.

    These are the ones received on topics, and those that the team published of the URDF files,
    which may have moved or changed since.
    """
    described = dict(values)
    topics = description_topics(values)
    for robot, block in values.items():
        topic = f"{robot}/{DESCRIPTION}"
        recorded = any(name.endswith(f"/{topic}") for name in run.topics)
        if isinstance(block, Mapping) and block.get("urdf") and recorded:
            topics.setdefault(robot, topic)
    for robot, topic in topics.items():
        for message in run.messages(topic):
            block = {**values[robot], "urdf_text": message.data}
            if not str(block["urdf"]).startswith(TOPIC):
                del block["urdf"]
            described[robot] = block
            break  # Nodes reject later descriptions.
    return described


def _coordinates(task: Subtask, series: TrajectorySeries, linear: Array, angular: Array) -> Array:
    """Return values or derivatives in a subtask's layout, shape (n, size) or (n, p).

    Args:
        task: The subtask.
        series: Recorded messages.
        linear: Translations or their derivatives, shape (n, elements, 3).
        angular: Quaternions or angular derivatives, shape (n, elements, 4 or 3).
    """
    elements = [series.names.index(name) for name in task.elements if name in series.names]
    width = len(task.axes) + (angular.shape[2] if task.rotates else 0)
    if len(elements) < len(task.elements):
        return np.full((len(linear), len(task.elements) * width), np.nan)
    axes = [AXES.index(axis) for axis in task.axes]
    parts = [linear[:, elements][:, :, axes]]
    if task.rotates:
        parts.append(angular[:, elements])
    return np.concatenate(parts, axis=2).reshape(len(linear), -1)


def common_times(a: Array, b: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the rows of a and of b with equal times, to the nanosecond."""
    stamps = [np.round(values * 1e9).astype(np.int64) for values in (a, b)]
    first, second = stamps
    _, rows, others = np.intersect1d(first, second, return_indices=True)
    return rows, others


def select(motion: RecordedMotion, rows: Any) -> RecordedMotion:
    """Select rows of a motion."""
    return RecordedMotion(
        motion.t[rows], motion.position[rows], motion.velocity[rows], motion.acceleration[rows]
    )
