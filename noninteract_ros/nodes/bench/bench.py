# SPDX-License-Identifier: Apache-2.0
"""Benchmarks with ROS: controller node, lockstep tick and wall-time period."""

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import rclpy
from rclpy.serialization import deserialize_message, serialize_message

from noninteract_ros.arrays import Array
from noninteract_ros.clock import seconds, tick_stamp
from noninteract_ros.errors import ScenarioError
from noninteract_ros.nodes.bench.programs import (
    NAMESPACE,
    RoundTrip,
    command_times,
    programs,
    ros,
    tick_times,
)
from noninteract_ros.nodes.common.parameter_files import rewrite, write
from noninteract_ros.nodes.common.wall_rate import WallRate
from noninteract_ros.nodes.controller.controller import Controller
from noninteract_ros.nodes.messages.cdr import JointStateCodec
from noninteract_ros.nodes.messages.messages import SubtaskCodec, to_wrench_stamped
from noninteract_ros.nodes.stack.monitor import StackError
from noninteract_ros.scenario import Scenario
from noninteract_ros.validation.benchmarks.bench import (
    PARTS,
    WARM_UP,
    BenchCase,
    BenchSettings,
    Row,
    Timed,
    bench_scenarios,
    time_alternately,
)
from noninteract_ros.validation.benchmarks.law import PinocchioTerms, law_rows
from noninteract_ros.validation.benchmarks.teams import bench_teams

ROUND_TRIP = "raw round trip of two processes"
SCENARIO = "scenario.yaml"
SLEEP = "absolute sleep alone, period error"


class ControllerCycle:
    """One lockstep tick of the controller node, from serialized inputs to serialized outputs.

    The callbacks are called as by an executor; published messages have no subscribers.

    Args:
        values: Values of a scenario.
        case: The same scenario and its first ticks.
        folder: Folder of the parameter file.
    """

    def __init__(self, values: Mapping[str, Any], case: BenchCase, folder: Path) -> None:
        self._scenario = case.scenario
        self._team = self._scenario.build_team()
        self._stack = self._scenario.build_stack(self._team)
        self._history = case.history
        self._joints = JointStateCodec(self._team.joint_names)
        self._codecs = {
            task.name: SubtaskCodec(task.name, task.elements, task.axes, task.rotates)
            for task in self._stack.subtasks
        }
        file = write(folder / SCENARIO, {**values, "lockstep": True})
        context = rclpy.Context()
        context.init(args=rewrite(["--ros-args", "--params-file", str(file)], folder))
        self._node = Controller(context=context, namespace=NAMESPACE)
        self._inputs = {
            item.topic_name.removeprefix(f"/{NAMESPACE}/"): item
            for item in self._node.subscriptions
        }
        self._tick = -1
        self._calls: list[tuple[Callable[[Any], None], Any]] = []

    def prepare(self) -> None:
        """Build all messages of the next tick."""
        self._tick += 1
        rate = self._scenario.general.rate
        stamp = tick_stamp(self._tick, rate)
        row = self._tick % len(self._history.t)
        self._calls = []
        for source in self._scenario.general.lockstep_sources:
            self._add(f"{source}/reference", self._reference(source.split("/")[0], stamp, row))
        if self._tick % max(1, round(rate / self._scenario.general.telemetry_rate)) == 0:
            for robot in self._scenario.general.force_sensors:
                wrench = serialize_message(to_wrench_stamped(stamp, np.zeros(6)))
                self._add(f"{robot}/external_wrench", wrench)
        q, v = self._history.q[row], self._history.v[row]
        positions = self._team.joints_from_configuration(q)
        self._add("joint_states", self._joints.encode(stamp, positions, v, np.zeros_like(v)))

    def _reference(self, subtask: str, stamp: int, row: int) -> bytes:
        number = self._stack.names.index(subtask)
        desired = self._history.desired[row][self._stack.value_slices[number]]
        zero = np.zeros(self._stack.subtasks[number].dim)
        return self._codecs[subtask].encode(stamp, desired, zero, zero)

    def _add(self, topic: str, data: bytes) -> None:
        subscription = self._inputs[topic]
        message = data if subscription.raw else deserialize_message(data, subscription.msg_type)
        self._calls.append((subscription.callback, message))

    def run(self) -> None:
        """Call all callbacks of one tick."""
        for callback, message in self._calls:
            callback(message)

    def close(self) -> None:
        """Destroy the node.

        Raises:
            StackError: The node has not computed all ticks, so that the times are invalid.
        """
        reached = self._node.status()[2]["time [s]"]
        self._node.destroy_node()
        self._node.context.try_shutdown()
        if reached != seconds(tick_stamp(self._tick, self._scenario.general.rate)):
            raise StackError(f"the controller stopped at {reached} s of {self._tick} ticks")


def node_rows(name: str, values: Mapping[str, Any], case: BenchCase, count: int) -> list[Row]:
    """Return the rows of the controller node on a scenario's team and of its baseline."""
    with TemporaryDirectory() as folder:
        controller = ControllerCycle(values, case, Path(folder))
        node, terms = f"controller node, {name}", f"Pinocchio's terms beside the node, {name}"
        timed: dict[str, Timed] = {node: controller, terms: PinocchioTerms(case)}
        times = time_alternately(timed, count)
        controller.close()
    return [Row("node", node, times[node], terms), Row("node", terms, times[terms])]


def measure(
    parts: Sequence[str],
    settings: BenchSettings,
    on_start: Callable[[str], None],
    on_skip: Callable[[str], None],
) -> list[Row]:
    """Measure some parts and return their rows, in the order of `PARTS`.

    Args:
        parts: Some of `PARTS`.
        settings: Numbers of ticks and rounds, and durations.
        on_start: Receives the name of the next measurement.
        on_skip: Receives the name of a skipped scenario and the reason.
    """
    scenarios = bench_scenarios()
    paper, teams = scenarios["paper"], bench_teams() if "law" in parts else {}
    rows: list[Row] = []
    chosen = scenarios if {"law", "node"} & set(parts) else {}
    for name, values in (chosen | teams).items():
        on_start(f"law and controller node, {name}")
        try:
            case = BenchCase.of(values, settings.ticks + WARM_UP)
        except ScenarioError as error:  # Robot models are an optional dependency.
            on_skip(f"{name} is skipped: {error}")
            continue
        if "law" in parts:
            rows += law_rows(name, case, settings.ticks)
        # With one state topic per robot there is no single input that completes a tick.
        if "node" in parts and name not in teams and not case.scenario.has_robot_state_topics:
            rows += node_rows(name, values, case, settings.ticks)
    if "lockstep" in parts:
        on_start("lockstep of the real programs")
        rows += lockstep_rows("paper", paper, settings)
    if "wall" in parts:
        on_start("wall time")
        rows += wall_rows("paper", paper, settings)
    return sorted(rows, key=lambda row: PARTS.index(row.part))


def lockstep_rows(name: str, values: Mapping[str, Any], settings: BenchSettings) -> list[Row]:
    """Return wall time per tick of the programs, with and without recorder, and the baseline."""
    scenario = Scenario.from_dict(values)
    labels = {False: f"lockstep tick, {name}", True: f"lockstep tick, {name}, recorded"}
    times: dict[str, list[Array]] = {name: [] for name in (*labels.values(), ROUND_TRIP)}
    with ros(), TemporaryDirectory() as folder:
        running = {"lockstep": True, "end_time": 0.0, "start_paused": False}
        file = write(Path(folder) / SCENARIO, {**values, **running})
        trip = RoundTrip(scenario.build_team().joint_names)
        try:
            for _ in range(settings.rounds):
                for record, label in labels.items():
                    times[ROUND_TRIP].append(trip.measure(settings.seconds))
                    with programs(scenario, file, Path(folder), record) as stack:
                        times[label].append(tick_times(stack, settings.seconds))
        finally:
            trip.close()
    rows = [
        Row("lockstep", label, np.concatenate(times[label]), ROUND_TRIP)
        for label in labels.values()
    ]
    return [*rows, Row("lockstep", ROUND_TRIP, np.concatenate(times[ROUND_TRIP]))]


def wall_rows(name: str, values: Mapping[str, Any], settings: BenchSettings) -> list[Row]:
    """Return period error of the controller's commands in wall time, and of sleeping alone."""
    scenario = Scenario.from_dict(values)
    loop = f"commands in wall time, {name}, period error"
    rate = scenario.general.rate
    times: dict[str, list[Array]] = {loop: [], SLEEP: []}
    with ros(), TemporaryDirectory() as folder:
        running = {"lockstep": False, "end_time": 0.0, "start_paused": False}
        file = write(Path(folder) / SCENARIO, {**values, **running})
        for _ in range(settings.rounds):
            times[SLEEP].append(_period_errors(_sleep(rate, settings.seconds), rate))
            with programs(scenario, file, Path(folder), False) as stack:
                times[loop].append(_period_errors(command_times(stack, settings.seconds), rate))
    errors = {label: np.concatenate(parts) for label, parts in times.items()}
    return [Row("wall", loop, errors[loop], SLEEP), Row("wall", SLEEP, errors[SLEEP])]


def _sleep(rate: float, duration: float) -> list[int]:
    """Return the wake-up times of a sleeping loop [ns]."""
    wall_rate, wake_ups = WallRate(rate), []
    for _ in range(round(rate * duration)):
        wall_rate.sleep()
        wake_ups.append(time.time_ns())
    return wake_ups


def _period_errors(times: list[int], rate: float) -> Array:
    """Return the absolute error of each period [us]."""
    return np.abs(1e-3 * np.diff(times) - 1e6 / rate)
