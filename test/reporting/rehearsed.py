# SPDX-License-Identifier: Apache-2.0
"""Recordings of rehearsals with the topics of the nodes."""

from collections.abc import Callable, Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from rclpy.serialization import serialize_message

from noninteract_ros.clock import stamp, tick_stamp
from noninteract_ros.control.energy.account import QUANTITIES, quantities
from noninteract_ros.control.telemetry.limit_activity import LimitActivity
from noninteract_ros.control.telemetry.subtask_energies import LABELS, rows
from noninteract_ros.nodes.messages.cdr import JointStateCodec
from noninteract_ros.nodes.messages.messages import (
    EnergyCodec,
    Level,
    SubtaskCodec,
    to_diagnostics,
    to_status,
    to_wrench_stamped,
)
from noninteract_ros.reporting.recording.run import Run
from noninteract_ros.reporting.recording.writer import RunWriter
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import nest
from noninteract_ros.scenario.rehearsal import Rehearsal
from noninteract_ros.sources.announcements import Announcer

JOINTS = "sensor_msgs/msg/JointState"
MOTION = "trajectory_msgs/msg/MultiDOFJointTrajectory"
WRENCH = "geometry_msgs/msg/WrenchStamped"
LABELLED = "std_msgs/msg/Float64MultiArray"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"

PAIR: dict[str, Any] = {
    "rate": 500.0,
    "telemetry_rate": 250.0,
    "robots": ["robot_1", "robot_2"],
    "robot_1": {"mass": 1.0, "initial_position": [0.3, 0.4]},
    "robot_2": {"mass": 2.0, "initial_position": [-0.3, -0.4]},
    "force_sensors": ["robot_1", "robot_2"],
    "subtasks": ["cooperative", "relative"],
    "cooperative": {
        "kind": "cooperative_position",
        "stiffness": [25.0],
        "damping": [53.0],
        "authority": "human",
        "takeover": "direct",
    },
    "relative": {
        "kind": "relative_position",
        "stiffness": [50.0],
        "damping": [25.0],
        "authority": "autonomy",
        "takeover": "direct",
    },
    "object": {"mass": 1.0, "stiffness": 20.0, "rest": [1.0, 1.0]},
    "haptic": {"motion": "paper", "start_time": 0.5, "update_rate": 500.0},
    "planner": {"formations": ["pair"], "pair": {"time": 0.0, "value": [1.0, 1.0]}},
}

Act = Callable[[Rehearsal], Any]
# Change a message before it is written, or drop it: topic, time [s], arrays to arrays or None.
Tamper = Callable[[str, float, list[np.ndarray]], list[np.ndarray] | None]


def scenario_values(**changes: Any) -> dict[str, Any]:
    """Return `PAIR` with keys such as `object__mass` changed; None removes a block."""
    values = deepcopy(PAIR)
    for name, value in nest({key.replace("__", "."): v for key, v in changes.items()}).items():
        if value is None:
            values.pop(name, None)
        elif isinstance(value, Mapping) and isinstance(values.get(name), dict):
            values[name].update(value)
        else:
            values[name] = value
    return values


def record(
    folder: Path,
    values: Mapping[str, Any],
    duration: float,
    tamper: Tamper | None = None,
    extra: Callable[[RunWriter], None] | None = None,
    acts: Mapping[float, Act] | None = None,
) -> Run:
    """Rehearse a scenario for a duration [s] and record all topics of the run.

    Acts are called at their times [s], like the actions of a person at the console.
    """
    folder.mkdir(parents=True, exist_ok=True)
    text = yaml.safe_dump({"/**": {"ros__parameters": dict(values)}})
    with RunWriter(folder / "run.mcap", text, overwrite=True) as writer:
        _Recording(writer, Scenario.from_dict(values), tamper, acts or {}).run(duration)
        if extra:
            extra(writer)
    return Run.open(folder)


class _Recording:
    def __init__(
        self,
        writer: RunWriter,
        scenario: Scenario,
        tamper: Tamper | None,
        acts: Mapping[float, Act],
    ) -> None:
        self._writer, self._tamper = writer, tamper
        self._acts = {round(time * scenario.general.rate): act for time, act in acts.items()}
        self._rehearsal = Rehearsal(scenario)
        self._rate = scenario.general.rate
        self._period = round(self._rate / scenario.general.telemetry_rate)
        team, stack = self._rehearsal.team, self._rehearsal.stack
        self._joints = JointStateCodec(team.joint_names)
        self._codecs = [
            SubtaskCodec(t.name, t.elements, t.axes, t.rotates) for t in stack.subtasks
        ]
        self._energy = EnergyCodec(LABELS)
        self._account = EnergyCodec(("time", *QUANTITIES))
        self._measured = 0.0
        self._watch = LimitActivity(team.joint_names)
        self._sources = []
        if scenario.haptic:
            device = scenario.build_haptic(stack)
            self._sources.append((scenario.haptic.subtask, "human", device))
        if scenario.planner:
            planner = scenario.build_planner(stack)
            self._sources.append((scenario.planner.subtask, "autonomy", planner))

    def _add(self, topic: str, kind: str, time: int, encode: Any, *arrays: np.ndarray) -> None:
        found: list[np.ndarray] | None = list(arrays)
        if self._tamper:
            found = self._tamper(topic, time / 1e9, list(arrays))
        if found is not None:
            self._writer.add(f"/team/{topic}", kind, time, time, encode(*found))

    def run(self, duration: float) -> None:
        self._add_references(duration)
        simulation = self._rehearsal.simulation
        for tick in range(round(duration * self._rate)):
            now = tick_stamp(tick, self._rate)
            if tick in self._acts:
                self._acts[tick](self._rehearsal)
            q = self._rehearsal.team.joints_from_configuration(simulation.q)
            v, effort = simulation.v, simulation.torque
            wrenches = simulation.external_wrenches()
            result = self._rehearsal.step()
            self._watch.record(now / 1e9, result)
            self._add(
                "joint_states", JOINTS, now, lambda *a, t=now: self._joints.encode(t, *a),
                q, v, effort,
            )  # fmt: skip
            self._add(
                "joint_commands", JOINTS, now,
                lambda a, t=now: self._joints.encode(t, effort=a), result.torque,
            )  # fmt: skip
            if tick % self._period == 0:
                self._add_telemetry(now, result, wrenches)
        values = {"law": self._rehearsal.controller.mode.law}
        status = to_status("/team/controller", Level.OK, "running", values)
        message = to_diagnostics(1, [status])
        self._writer.add("/diagnostics", DIAGNOSTICS, 1, 1, serialize_message(message))

    def _add_references(self, duration: float) -> None:
        for subtask, source, sampler in self._sources:
            announcer = Announcer(sampler, self._rate)
            announcer.reset(0.0)
            codec = next(codec for codec in self._codecs if codec.name == subtask)
            for time, reference in announcer.announce(duration):
                if reference is not None:
                    motion = reference.position, reference.velocity, reference.acceleration
                    self._add(
                        f"{subtask}/{source}/reference", MOTION, time,
                        lambda *a, c=codec, t=time: c.encode(t, *a), *motion,
                    )  # fmt: skip

    def _add_telemetry(self, now: int, tick: Any, wrenches: np.ndarray) -> None:
        team, stack = self._rehearsal.team, self._rehearsal.stack
        for name, wrench in zip(team.names, wrenches, strict=True):
            self._add(
                f"{name}/external_wrench", WRENCH, now,
                lambda a, t=now: serialize_message(to_wrench_stamped(t, a)), wrench,
            )  # fmt: skip
        energy = self._rehearsal.energy(tick, wrenches)
        accounts = rows(now / 1e9, tick, energy, self._watch)
        for i, (codec, part) in enumerate(zip(self._codecs, stack.slices, strict=True)):
            wanted, values = tick.led[i].reference, stack.value_slices[i]
            encode = lambda *a, c=codec: c.encode(now, *a)  # noqa: E731
            self._add(
                f"{codec.name}/state", MOTION, now, encode, tick.task.x[values], tick.x_rate[part]
            )
            self._add(
                f"{codec.name}/desired", MOTION, now, encode,
                wanted.position, wanted.velocity, wanted.acceleration,
            )  # fmt: skip
            self._add(f"{codec.name}/energy", LABELLED, now, self._energy.encode, accounts[i])
        self._add_account(now, tick, team.external_torque(tick.state, wrenches))

    def _add_account(self, now: int, tick: Any, external: np.ndarray) -> None:
        """Add the energy account of the team."""
        supplied = float(tick.error.e_rate @ tick.dynamics.force_of(external))
        self._measured += supplied * self._period / self._rate
        values = now / 1e9, *quantities(tick.account, supplied, self._measured)
        self._add("energy", LABELLED, now, self._account.encode, np.array(values, dtype=float))


def reference(codec: SubtaskCodec, time: float, position: np.ndarray) -> bytes:
    """Serialize a reference at rest."""
    return codec.encode(stamp(time), position, 0 * position, 0 * position)


def tamper_account(change: Callable[[dict[str, float]], None]) -> Tamper:
    """Return a tamper function that changes the recorded account of the team by label."""

    def tamper(topic: str, time: float, arrays: list[np.ndarray]) -> list[np.ndarray]:
        if topic == "energy":
            columns = dict(zip(("time", *QUANTITIES), arrays[0], strict=True))
            change(columns)
            return [np.array(list(columns.values()))]
        return arrays

    return tamper
