# SPDX-License-Identifier: Apache-2.0
"""A recorded run together with the scenario it was recorded with, in the law's coordinates."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.control.references.subtask_input import AUTHORITIES
from noninteract_ros.errors import RecordingError, ScenarioError
from noninteract_ros.reporting.recording.run import Run
from noninteract_ros.reporting.recording.series import JointSeries, TrajectorySeries
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.blocks import description_topics
from noninteract_ros.scenario.files import nest
from noninteract_ros.subtasks.subtask import Subtask
from noninteract_ros.team.robot import AXES

INTERVENTIONS = "interventions"
FRICTION = "the joints have friction, which neither the law nor a sensor at a tool knows"


@dataclass(frozen=True)
class RecordedMotion:
    """A motion of one subtask at some instants.

    Attributes:
        t: Time of the run, shape (n,) [s].
        position: Values, with the quaternions of rotating elements, shape (n, size).
        velocity: Shape (n, p) [m/s; rad/s].
        acceleration: Shape (n, p) [m/s^2; rad/s^2]; NaN where it was not sent.
    """

    t: Array
    position: Array
    velocity: Array
    acceleration: Array


@dataclass(frozen=True)
class Tracking:
    """Actual and desired motion of one subtask at the same instants.

    Attributes:
        t: Time of the run, shape (n,) [s].
        actual: Actual motion.
        desired: Desired motion.
    """

    t: Array
    actual: RecordedMotion
    desired: RecordedMotion


class Recorded:
    """What was recorded, as arrays in the order of the team's joints and the subtasks' axes.

    The time of the run is simulated time in lockstep; otherwise it counts from the first state.

    Args:
        run: The recording.

    Attributes:
        scenario: The scenario it holds.
        team: The robots.
        stack: Their subtasks.
        ticks: Number of each state's tick, shape (n,).
        t: Time of each state, shape (n,) [s].
        q: Configurations, shape (n, nq).
        v: Velocities, shape (n, n).
        torque: Torques that were held until each state, shape (n, n).

    Raises:
        RecordingError: The recording holds no scenario, a wrong one, or not the joint states.
    """

    def __init__(self, run: Run) -> None:
        self.run = run
        self.scenario = scenario_of(run)
        self.team = self.scenario.build_team()
        self.stack = self.scenario.build_stack(self.team)
        self.states = run.joints("joint_states")
        if len(self.states.stamps) < 2:
            raise RecordingError(f"{run.path}: holds fewer than 2 joint states")
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
        """Whether all inertias and Jacobians are constant: point masses and their positions."""
        turning = len(self.team.q0) > self.team.n  # Continuous joints are no plain numbers.
        if turning or any(task.rotates for task in self.stack.subtasks):
            return False
        step, still = np.random.default_rng(0).uniform(-0.5, 0.5, (2, self.team.n))
        here = self.team.state(self.team.q0, np.zeros(self.team.n))
        there = self.team.state(self.team.integrate(self.team.q0, step), still)
        J, moved = (self.stack.evaluate(state) for state in (here, there))
        same = np.allclose(here.M, there.M) and np.allclose(J.J, moved.J)
        return bool(same and not there.C.any() and not moved.J_rate.any())

    @cached_property
    def steps(self) -> Array:
        """Tangent vectors from each state to the next, shape (n - 1, n)."""
        if self.q.shape[1] == self.team.n:
            return np.diff(self.q, axis=0)
        return np.array([self.team.difference(*pair) for pair in pairwise(self.q)])

    @cached_property
    def values(self) -> tuple[Array, Array]:
        """Subtask values (n, size) and velocities (n, p) at each state."""
        return self.task_values(self.q, self.v)

    def task_values(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Subtask values and velocities of states q (n, nq) and v (n, n)."""
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
        """How many numbers all subtasks' values have."""
        return self.stack.value_slices[-1].stop

    def part(self, name: str) -> slice:
        """Coordinates of a subtask among all."""
        return self.stack.slices[self.stack.names.index(name)]

    def task(self, name: str) -> Subtask:
        """A subtask by name."""
        return self.stack.subtasks[self.stack.names.index(name)]

    def has(self, topic: str) -> bool:
        """Whether the recording has messages of a topic, given by the end of its name."""
        return any(name.endswith(f"/{topic}") for name in self.run.topics)

    def team_topic(self, name: str) -> str:
        """Full name of a topic of the team itself, which some subtask's may end with as well."""
        ends = (topic for topic in self.run.topics if topic.endswith("/joint_states"))
        states = min(ends, key=len)  # A robot may have one of its own, in a deeper namespace.
        return states.removesuffix("joint_states") + name

    def motion(self, topic: str, subtask: str) -> RecordedMotion:
        """State, desired motion or references of a subtask.

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
        """Actual and desired motion of a subtask at the instants that both have.

        Raises:
            RecordingError: A topic is missing or of another type.
        """
        actual = self.motion(f"{subtask}/state", subtask)
        desired = self.motion(f"{subtask}/desired", subtask)
        rows, others = common_instants(actual.t, desired.t)
        return Tracking(actual.t[rows], select(actual, rows), select(desired, others))

    def since_start(self, stamps: Array) -> Array:
        """Time of the run of stamps [s]."""
        return stamps - self._origin

    def reference_topic(self, subtask: str) -> str | None:
        """Topic of the references that lead a subtask; None where nobody does, or says so."""
        authority = self.scenario.subtasks[subtask].input.authority
        topic = f"{subtask}/{authority}/reference"
        return topic if self.has(topic) else None

    def told(self, subtask: str, label: str) -> tuple[Array, Array] | None:
        """Times [s] and values of a number on a subtask's account, shape (n,) each, if told."""
        if not self.has(topic := f"{subtask}/energy"):
            return None
        series = self.run.labelled(topic)
        if label not in series.labels:
            return None
        return self.since_start(series.stamps), series[label]

    def interventions(self, end: float = np.inf) -> int:
        """Ticks up to a time [s] whose torque was another one than the law's, as it was told."""
        if (told := self.told(self.stack.names[0], INTERVENTIONS)) is None:
            return 0
        t, counts = told
        return int(counts[t <= end].max(initial=0.0))

    def start(self, subtask: str) -> float | None:
        """When a subtask is first led [s]; None where nobody leads it."""
        if (told := self.told(subtask, "leader")) is not None:
            t, leader = told
            led = t[leader != AUTHORITIES.index("hold")]
            return float(led[0]) if len(led) else None
        topic = self.reference_topic(subtask)
        if topic is None:
            return None
        t = self.motion(topic, subtask).t
        return float(max(t.min(), self.t[0])) if len(t) else None


def scenario_of(run: Run) -> Scenario:
    """The scenario that a recording holds.

    Raises:
        RecordingError: There is none, or it is wrong.
    """
    if run.scenario is None:
        raise RecordingError(f"{run.path}: holds no scenario, so that it cannot be analysed")
    try:
        values = _parameters(yaml.safe_load(run.scenario))
        return Scenario.from_dict(_described(run, values))
    except (ScenarioError, yaml.YAMLError, KeyError, TypeError, AttributeError) as error:
        reason = " ".join(str(error).split())
        raise RecordingError(f"{run.path}: its scenario is wrong: {reason}") from error


def _parameters(content: Any) -> Mapping[str, Any]:
    merged: dict[str, Any] = {}
    for block in content.values():
        merged.update(block["ros__parameters"])
    return nest(merged)


def _described(run: Run, values: Mapping[str, Any]) -> Mapping[str, Any]:
    """The same scenario with the robots' descriptions that came on topics."""
    described = dict(values)
    for robot, topic in description_topics(values).items():
        for message in run.messages(topic):
            described[robot] = {**described[robot], "urdf_text": message.data}
            break  # One that comes later is refused by the programs.
    return described


def _coordinates(task: Subtask, series: TrajectorySeries, linear: Array, turning: Array) -> Array:
    """Numbers of a subtask's layout, element by element, shape (n, size) or (n, p).

    Args:
        task: The subtask.
        series: What was recorded.
        linear: Its translations, or their derivatives, shape (n, elements, 3).
        turning: Its quaternions, or angular derivatives, shape (n, elements, 4 or 3).
    """
    elements = [series.names.index(name) for name in task.elements if name in series.names]
    width = len(task.axes) + (turning.shape[2] if task.rotates else 0)
    if len(elements) < len(task.elements):
        return np.full((len(linear), len(task.elements) * width), np.nan)
    axes = [AXES.index(axis) for axis in task.axes]
    parts = [linear[:, elements][:, :, axes]]
    if task.rotates:
        parts.append(turning[:, elements])
    return np.concatenate(parts, axis=2).reshape(len(linear), -1)


def common_instants(a: Array, b: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows of a and of b at which both have the same time, to the nanosecond."""
    stamps = [np.round(values * 1e9).astype(np.int64) for values in (a, b)]
    first, second = stamps
    _, rows, others = np.intersect1d(first, second, return_indices=True)
    return rows, others


def select(motion: RecordedMotion, rows: Any) -> RecordedMotion:
    """Some instants of a motion."""
    return RecordedMotion(
        motion.t[rows], motion.position[rows], motion.velocity[rows], motion.acceleration[rows]
    )
