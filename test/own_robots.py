# SPDX-License-Identifier: Apache-2.0
"""Robots as drivers under ros2_control show them, and a controller whose time a test makes."""

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

WIRING = (
    "joint_states_topic",
    "joint_states_rate",
    "joint_prefix",
    "effort_topic",
    "effort_joints",
    "gravity_compensated",
)


def own_robots(**changes: Any) -> dict[str, Any]:
    """The scenario own_robots without its sources, in wall time, with changes."""
    values = read_parameters(ROOT / "config" / "own_robots.yaml")
    alone = {"haptic": None, "planner": None, "lockstep_sources": None, "lockstep": False}
    return merged(merged(values, alone), changes)


def one_topic(values: Mapping[str, Any]) -> dict[str, Any]:
    """The same scenario on the team's topics."""
    bare = dict.fromkeys(WIRING)
    return merged(values, dict.fromkeys(values["robots"], bare))


@dataclass
class Driver:
    """One arm's joint_state_broadcaster and effort controller.

    Attributes:
        order: What the broadcaster tells of, in its order; whatever is no joint stands still.
        efforts: Joints of the effort controller, in its order.
        torque: What the controller was told last, by joint; zeros before.
    """

    states_topic: str
    effort_topic: str
    joints: Sequence[str]
    order: Sequence[str]
    efforts: Sequence[str]
    compensates: bool = False
    torque: dict[str, float] = field(default_factory=dict)

    def state(self, stamp: int, q: np.ndarray, v: np.ndarray) -> bytes:
        """What it tells of a moment [ns]; of efforts it knows none."""
        moving = dict(zip(self.joints, zip(q, v, strict=True), strict=True))
        rows = [moving.get(name, (0.02, 0.0)) for name in self.order]
        message = JointState(name=self.order)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        message.position, message.velocity = ([row[i] for row in rows] for i in (0, 1))
        message.effort = [float("nan")] * len(rows)
        return serialize_message(message)

    def hear(self, data: bytes) -> None:
        """Takes an array as a forward_command_controller does: by its order, nothing else."""
        told = deserialize_message(data, Float64MultiArray).data
        assert len(told) == len(self.efforts)
        self.torque = dict(zip(self.efforts, told, strict=True))

    def applied(self, gravity: np.ndarray) -> np.ndarray:
        """Torque of its motors."""
        told = np.array([self.torque.get(joint, 0.0) for joint in self.joints])
        return told + gravity if self.compensates else told


def drivers() -> dict[str, Driver]:
    """The two arms of own_robots; each broadcaster has its own idea of order."""
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


class _Tap:
    """In the place of a publisher: keeps what is published."""

    def __init__(self, kept: list[Any]) -> None:
        self.publish = kept.append


class HandDriven(Controller):
    """A controller that nobody spins: a test calls what comes in and reads what goes out.

    Attributes:
        said: Messages by full topic.
    """

    def __init__(self, **kwargs: Any) -> None:
        self.said: dict[str, list[Any]] = {}
        super().__init__(**kwargs)

    def create_publisher(self, kind: Any, topic: str, *args: Any, **kwargs: Any) -> Any:
        """A tap of the topic, but for those of rclpy itself."""
        if topic.startswith(("~", "/")):
            return super().create_publisher(kind, topic, *args, **kwargs)
        return _Tap(self.said.setdefault(self.resolve_topic_name(topic), []))

    def services_answer(self, name: str) -> Trigger.Response:
        """What `~/stop` or `~/resume` answers."""
        service = next(item for item in self.services if item.srv_name.endswith(f"/{name}"))
        return service.callback(Trigger.Request(), Trigger.Response())

    def hear(self, topic: str, message: Any) -> None:
        """Something comes in on a full topic."""
        heard = [item for item in self.subscriptions if item.topic_name == topic]
        assert heard, topic
        for item in heard:
            item.callback(message)


def hand_driven(ros: Any, values: Mapping[str, Any]) -> HandDriven:
    """A controller of a scenario, in a harness's context."""
    overrides = [Parameter(key, value=value) for key, value in flat(values)]
    return HandDriven(context=ros.context, parameter_overrides=overrides)


class Hall:
    """Two arms under gravity, their drivers and a controller; its time is that of the test.

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
        self.controller = hand_driven(ros, values)

    def stamp(self) -> int:
        """Simulated time [ns], from one second on."""
        return 10**9 + round(1e9 * self.simulation.now)

    def state(self, name: str) -> bytes:
        """What a robot tells of itself now."""
        part = self._part(name)
        q, v = self.simulation.q[part], self.simulation.v[part]
        return self.drivers[name].state(self.stamp(), q, v)

    def tell(self, *names: str) -> None:
        """Robots tell their states."""
        for name in names:
            self.controller.hear(self.drivers[name].states_topic, self.state(name))

    def turn(self) -> None:
        """The controller takes a turn, and the drivers hear what it says."""
        self.controller.run_once()
        for driver in self.drivers.values():
            said = self.controller.said[driver.effort_topic]
            if said:
                driver.hear(said[-1])
                said.clear()

    def step(self) -> None:
        """A tick of the simulation under the drivers' torques."""
        gravity = self.team.gravity(self.simulation.q)
        parts = [
            driver.applied(gravity[self._part(name)]) for name, driver in self.drivers.items()
        ]
        self.simulation.step(np.concatenate(parts))

    def error(self, subtask: str) -> float:
        """How far a subtask is from where it was at the start [m]."""
        part = self.stack.value_slices[self.stack.names.index(subtask)]
        start = self.stack.evaluate(self.team.state(self.team.q0, np.zeros(self.team.n))).x
        now = self.stack.evaluate(self.team.state(self.simulation.q, self.simulation.v)).x
        return float(np.abs(now - start)[part].max())

    def status(self) -> tuple[int, str]:
        """Level and sentence that the controller would tell."""
        level, text, _ = self.controller.status()
        return int(level), text

    def _part(self, name: str) -> slice:
        return self.team.velocity_slices[self.team.index(name)]
