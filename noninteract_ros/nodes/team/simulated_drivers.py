# SPDX-License-Identifier: Apache-2.0
"""Drivers of the simulated robots: states out, torques in, poses of bodies out.

Robots are on the topics of the team, or each on topics of its own as real robots are.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from noninteract_ros.arrays import Array
from noninteract_ros.errors import InputError
from noninteract_ros.nodes.common.efforts import EffortCodec
from noninteract_ros.nodes.common.guarded_node import LOOP_QOS
from noninteract_ros.nodes.common.loop_input import LoopInput
from noninteract_ros.nodes.common.node import ScenarioNode
from noninteract_ros.nodes.common.publisher_binding import PublisherWatch
from noninteract_ros.nodes.messages.cdr import JointStateCodec
from noninteract_ros.nodes.messages.messages import WORLD, to_stamp
from noninteract_ros.simulation.team_simulation import TeamSimulation
from noninteract_ros.team.team import Team

CommandCallback = Callable[[int | None, Array], None]


@dataclass
class _CommandInput:
    """Torque topic of one robot, or of all robots without their own.

    Attributes:
        names: Names of the robots.
        joints: Indices of their joints in the team.
        compensates_gravity: True where gravity torque is added to the received torque.
        stamp: Stamp of the last answered state [ns], None if the message has none.
        received_at: Monotonic time of the last message [s]; -inf before the first one.
    """

    names: list[str]
    joints: list[int]
    compensates_gravity: bool = False
    stamp: int | None = None
    received_at: float = -np.inf


@dataclass(frozen=True)
class _StateOutput:
    """Joint state topic of one robot, or of the team.

    Attributes:
        joints: Joints in the message.
        codec: Codec of the message.
        publisher: Publisher of serialized messages.
        period: Ticks between messages.
        first: Tick of the first message.
    """

    joints: slice
    codec: JointStateCodec
    publisher: Any
    period: int = 1
    first: int = 0


class SimulatedDrivers:
    """Publishers of joint states and subscriptions to torques, on the topics of the topics.

    Torques are passed on once every robot has received its own; in lockstep, once all of them
    answer the same state.

    Args:
        node: Node of the simulated team.
        team: Robot team.
        on_command: Called with the stamp of the answered state [ns], or None, and the torques of
            all joints, shape (n,) [N or N m].
    """

    def __init__(self, node: ScenarioNode, team: Team, on_command: CommandCallback) -> None:
        self._node, self._team, self._callback = node, team, on_command
        self._timeout = np.inf if node.lockstep else node.scenario.general.command_timeout
        self._torque = np.zeros(team.n)
        self._inputs: list[_CommandInput] = []
        self._outputs: list[_StateOutput] = []
        self._commands: LoopInput | None = None
        if not node.scenario.has_robot_state_topics:
            publisher = node.create_publisher(JointState, "joint_states", LOOP_QOS)
            codec = JointStateCodec(team.joint_names)
            output = _StateOutput(joints=slice(0, team.n), codec=codec, publisher=publisher)
            self._outputs.append(output)
        shared = _CommandInput([], [])
        for index, robot in enumerate(team.robots):
            topics = node.scenario.robots[robot.name].topics
            if topics.joint_states_topic:
                self._add_output(index)
            if topics.effort_topic:
                self._add_input(index)
            else:
                part = team.velocity_slices[index]
                shared.names.append(robot.name)
                shared.joints += range(part.start, part.stop)
        if shared.names:
            self._inputs.append(shared)
            codec = JointStateCodec(team.joint_names, required=("effort",))
            self._receive_commands = partial(self._on_commands, shared, codec)
            if node.lockstep:
                node.subscribe(JointState, "joint_commands", self._receive_commands, raw=True)
                node.publisher_watch = PublisherWatch(node, "joint_commands")
            else:
                self._commands = LoopInput(node, JointState, "joint_commands")

    def poll(self) -> None:
        """Wall time: process received torques of the whole team."""
        if self._commands is not None:
            self._commands.poll(self._receive_commands)

    def problem(self) -> str:
        """Return the reason why no torques of the whole team are applied, or ""."""
        return self._commands.problem() if self._commands else ""

    def _add_output(self, index: int) -> None:
        general, robot = self._node.scenario.general, self._team.robots[index]
        topics = self._node.scenario.robots[robot.name].topics
        publisher = self._node.create_publisher(JointState, topics.joint_states_topic, LOOP_QOS)
        codec = JointStateCodec(topics.driver_joints(list(robot.model.names)[1:]))
        own_rate = topics.joint_states_rate and not self._node.lockstep
        period = max(1, round(general.rate / topics.joint_states_rate)) if own_rate else 1
        # Robots of one rate publish at different ticks, as real ones do.
        output = _StateOutput(
            joints=self._team.velocity_slices[index],
            codec=codec,
            publisher=publisher,
            period=period,
            first=index % period,
        )
        self._outputs.append(output)

    def _add_input(self, index: int) -> None:
        robot, part = self._team.robots[index], self._team.velocity_slices[index]
        topics = self._node.scenario.robots[robot.name].topics
        command_input = _CommandInput(
            [robot.name], list(range(part.start, part.stop)), topics.gravity_compensated
        )
        codec = EffortCodec(topics.effort_order(list(robot.model.names)[1:]))
        self._inputs.append(command_input)
        callback = partial(self._on_efforts, command_input, codec)
        self._node.subscribe(Float64MultiArray, topics.effort_topic, callback)

    def _on_commands(
        self, command_input: _CommandInput, codec: JointStateCodec, data: bytes
    ) -> None:
        stamp, _, _, effort = codec.decode(data)
        assert effort is not None  # The codec requires it.
        self._receive(command_input, stamp, effort[command_input.joints])

    def _on_efforts(
        self, command_input: _CommandInput, codec: EffortCodec, message: Float64MultiArray
    ) -> None:
        stamp, torque = codec.decode(message)
        if stamp is None and self._node.lockstep:
            raise InputError("the label has no stamp of the answered state, required in lockstep")
        self._receive(command_input, stamp, torque)

    def _receive(self, command_input: _CommandInput, stamp: int | None, torque: Array) -> None:
        self._torque[command_input.joints] = torque
        command_input.stamp, command_input.received_at = stamp, time.monotonic()
        if any(other.received_at == -np.inf for other in self._inputs):
            return
        if self._node.lockstep and any(other.stamp != stamp for other in self._inputs):
            return
        self._callback(stamp, self._torque.copy())

    def applied(self, torque: Array, q: Array, v: Array) -> Array:
        """Return the motor torques over a tick that begins at (q, v), shape (n,) [N or N m].

        Robots that compensate gravity add it to the received torque. Robots whose torques have
        timed out brake.
        """
        timed_out = self.timed_out()
        if not timed_out and not any(item.compensates_gravity for item in self._inputs):
            return torque
        result, gravity = torque.copy(), self._team.gravity(q)
        brake = gravity - self._team.brake_damping * v
        for item in self._inputs:
            joints = item.joints
            if item.names[0] in timed_out:
                result[joints] = brake[joints]
            elif item.compensates_gravity:
                result[joints] += gravity[joints]
        return result

    def timed_out(self) -> list[str]:
        """Return the robots whose torques have timed out."""
        limit = time.monotonic() - self._timeout
        late = [item for item in self._inputs if item.received_at < limit]
        return [name for item in late for name in item.names]

    def publish(self, stamp_ns: int, tick: int, arrays: tuple[Array, Array, Array]) -> None:
        """Publish the state of a tick: positions, velocities and torques, shape (n,) each."""
        for output in self._outputs:
            if tick % output.period == output.first:
                values = [array[output.joints] for array in arrays]
                output.publisher.publish(output.codec.encode(stamp_ns, *values))


class BodyPosePublisher:
    """Publishers of the poses of simulated objects and doors, on `<body>/pose`.

    Args:
        node: Node of the simulated team.
        simulation: Simulated team.
    """

    def __init__(self, node: ScenarioNode, simulation: TeamSimulation) -> None:
        self._simulation = simulation
        self._publishers = {
            name: node.create_publisher(PoseStamped, f"{name}/pose", LOOP_QOS)
            for name in simulation.plant.body_names
        }

    def publish(self, stamp: int) -> None:
        """Publish the poses with the stamp [ns] of their state."""
        if not self._publishers:
            return
        poses = self._simulation.plant.body_poses(self._simulation.plant_q)
        for name, publisher in self._publishers.items():
            message = PoseStamped()
            message.header.stamp, message.header.frame_id = to_stamp(stamp), WORLD
            position, orientation = message.pose.position, message.pose.orientation
            position.x, position.y, position.z = poses[name][:3].tolist()
            orientation.x, orientation.y, orientation.z, orientation.w = poses[name][3:].tolist()
            publisher.publish(message)
