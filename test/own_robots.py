# SPDX-License-Identifier: Apache-2.0
"""Drivers of robots under ros2_control, and a controller that a test steps."""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from harness import flat, merged
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message, serialize_message
from repository import ROOT
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from noninteract_ros.nodes.controller.controller import Controller
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import read_parameters
from noninteract_ros.simulation.team_simulation import TeamSimulation

TOPIC_KEYS = (
    "joint_states_topic",
    "joint_states_rate",
    "joint_prefix",
    "effort_topic",
    "effort_joints",
    "gravity_compensated",
)


def own_robots(**changes: Any) -> dict[str, Any]:
    """Scenario own_robots without its sources, in wall time, with changes."""
    values = read_parameters(ROOT / "config" / "own_robots.yaml")
    alone = {"haptic": None, "planner": None, "lockstep_sources": None, "lockstep": False}
    return merged(merged(values, alone), changes)


def with_team_topics(values: Mapping[str, Any]) -> dict[str, Any]:
    """Scenario with the robots on the team's topics."""
    bare = dict.fromkeys(TOPIC_KEYS)
    return merged(values, dict.fromkeys(values["robots"], bare))


@dataclass
class Driver:
    """One arm's joint_state_broadcaster and effort controller.

    Attributes:
        order: Names in the joint states, in order; a name that is no joint stands still.
        efforts: Joints of the effort controller, in its order.
        torque: Last received effort of each joint; zeros before the first.
    """

    states_topic: str
    effort_topic: str
    joints: Sequence[str]
    order: Sequence[str]
    efforts: Sequence[str]
    compensates: bool = False
    torque: dict[str, float] = field(default_factory=dict)

    def state(self, stamp: int, q: np.ndarray, v: np.ndarray) -> bytes:
        """Encode the joint states at a stamp [ns], without efforts."""
        moving = dict(zip(self.joints, zip(q, v, strict=True), strict=True))
        rows = [moving.get(name, (0.02, 0.0)) for name in self.order]
        message = JointState(name=self.order)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        message.position, message.velocity = ([row[i] for row in rows] for i in (0, 1))
        message.effort = [float("nan")] * len(rows)
        return serialize_message(message)

    def receive(self, data: bytes) -> None:
        """Receive efforts as a forward_command_controller does: by their order only."""
        efforts = deserialize_message(data, Float64MultiArray).data
        assert len(efforts) == len(self.efforts)
        self.torque = dict(zip(self.efforts, efforts, strict=True))

    def applied(self, gravity: np.ndarray) -> np.ndarray:
        """Torque of the motors."""
        efforts = np.array([self.torque.get(joint, 0.0) for joint in self.joints])
        return efforts + gravity if self.compensates else efforts


def drivers() -> dict[str, Driver]:
    """Drivers of the two arms of own_robots, each with its own order of joints."""
    left, right = ["left_joint_1", "left_joint_2"], ["joint_1", "joint_2"]
    return {
        "left": Driver(
            "/team/left/joint_states",
            "/team/left_effort_controller/commands",
            left,
            ["left_finger", "left_joint_2", "left_joint_1"],
            left[::-1],
            compensates=True,
        ),
        "right": Driver(
            "/team/right/joint_states",
            "/team/right_effort_controller/commands",
            right,
            right,
            right,
        ),
    }


class _RecordingPublisher:
    """Replacement of a publisher that records the messages."""

    def __init__(self, kept: list[Any]) -> None:
        self.publish = kept.append


class SteppedController(Controller):
    """Controller without an executor: a test delivers messages and reads the published ones.

    Attributes:
        published: Messages by full topic.
    """

    def __init__(self, **kwargs: Any) -> None:
        self.published: dict[str, list[Any]] = {}
        self._time_ns = 0
        super().__init__(**kwargs)

    def create_publisher(self, kind: Any, topic: str, *args: Any, **kwargs: Any) -> Any:
        """Record messages, except on topics of rclpy itself."""
        if topic.startswith(("~", "/")):
            return super().create_publisher(kind, topic, *args, **kwargs)
        return _RecordingPublisher(self.published.setdefault(self.resolve_topic_name(topic), []))

    def call_service(self, name: str) -> Trigger.Response:
        """Call `~/stop` or `~/resume` and return the response."""
        service = next(item for item in self.services if item.srv_name.endswith(f"/{name}"))
        return service.callback(Trigger.Request(), Trigger.Response())

    def now_ns(self) -> int:
        """Return the newest stamp received, as the clock of the robots."""
        return self._time_ns

    def receive(self, topic: str, message: Any) -> None:
        """Deliver a message to the subscriptions of a full topic."""
        if isinstance(message, bytes):
            seconds, nanoseconds = struct.unpack_from("<iI", message, 4)
            self._time_ns = max(self._time_ns, seconds * 10**9 + nanoseconds)
        if topic == "/team/joint_states" and self._interface.states is not None:
            self._interface.receive(message)
            return
        subscriptions = [item for item in self.subscriptions if item.topic_name == topic]
        assert subscriptions, topic
        for item in subscriptions:
            item.callback(message)


def stepped_controller(ros: Any, values: Mapping[str, Any]) -> SteppedController:
    """Controller of a scenario, in a harness's context."""
    overrides = [Parameter(key, value=value) for key, value in flat(values)]
    return SteppedController(context=ros.context, parameter_overrides=overrides)


class SimulatedArms:
    """Two arms under gravity, their drivers and a controller, in simulated time.

    Args:
        ros: Harness.
        values: Scenario, with topics for each robot.
        steps: Ticks of the simulation in a millisecond.
    """

    def __init__(self, ros: Any, values: Mapping[str, Any], steps: int = 2) -> None:
        self.scenario = Scenario.from_dict(dict(values))
        team = self.scenario.build_team()
        self.team, self.drivers = team, drivers()
        self.stack = self.scenario.build_stack(team)
        plant = self.scenario.build_simulation(team, self.stack).plant
        pushes = list(self.scenario.pushes.values())
        self.simulation = TeamSimulation(plant, 1000.0 * steps, pushes=pushes)
        self.controller = stepped_controller(ros, values)

    def stamp(self) -> int:
        """Simulated time [ns], from one second on."""
        return 10**9 + round(1e9 * self.simulation.now)

    def state(self, name: str) -> bytes:
        """Encode the current joint states of a robot."""
        part = self._part(name)
        q, v = self.simulation.q[part], self.simulation.v[part]
        return self.drivers[name].state(self.stamp(), q, v)

    def publish_states(self, *names: str) -> None:
        """Deliver the current states of robots to the controller."""
        for name in names:
            self.controller.receive(self.drivers[name].states_topic, self.state(name))

    def run_controller(self) -> None:
        """Run the controller once, and deliver its efforts to the drivers."""
        self.controller.run_once()
        for driver in self.drivers.values():
            efforts = self.controller.published[driver.effort_topic]
            if efforts:
                driver.receive(efforts[-1])
                efforts.clear()

    def step(self) -> None:
        """Step the simulation under the drivers' torques."""
        gravity = self.team.gravity(self.simulation.q)
        parts = [
            driver.applied(gravity[self._part(name)]) for name, driver in self.drivers.items()
        ]
        self.simulation.step(np.concatenate(parts))

    def error(self, subtask: str) -> float:
        """Largest deviation of a subtask from its start [m]."""
        part = self.stack.value_slices[self.stack.names.index(subtask)]
        start = self.stack.evaluate(self.team.state(self.team.q0, np.zeros(self.team.n))).x
        now = self.stack.evaluate(self.team.state(self.simulation.q, self.simulation.v)).x
        return float(np.abs(now - start)[part].max())

    def status(self) -> tuple[int, str]:
        """Level and text of the controller's diagnostics."""
        level, text, _ = self.controller.status()
        return int(level), text

    def _part(self, name: str) -> slice:
        return self.team.velocity_slices[self.team.index(name)]
