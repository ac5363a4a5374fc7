# SPDX-License-Identifier: Apache-2.0
"""The topics of simulated robots: those of the team, or each its own, as real robots have."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from noninteract_ros.arrays import Array
from noninteract_ros.errors import InputError
from noninteract_ros.nodes.common.efforts import EffortCodec
from noninteract_ros.nodes.common.node import LOOP_QOS, ScenarioNode
from noninteract_ros.nodes.messages.cdr import JointStateCodec
from noninteract_ros.team.team import Team

TakeCommand = Callable[[int | None, Array], None]


@dataclass
class _Listener:
    """Who hears torques on one topic: a robot, or all that have none of their own.

    Attributes:
        names: The robots.
        joints: Places of their joints in the team's order.
        compensated: Whether gravity torque is added to what is heard.
        stamp: Stamp of the state that was answered last [ns], None where it was not told.
        heard_at: When, by the monotonic clock [s]; -inf before the first time.
    """

    names: list[str]
    joints: list[int]
    compensated: bool = False
    stamp: int | None = None
    heard_at: float = -np.inf


@dataclass(frozen=True)
class _Speaker:
    """Who tells of joints on one topic, every so many ticks, from some tick on."""

    part: slice
    codec: JointStateCodec
    publisher: Any
    period: int = 1
    first: int = 0


class RobotPorts:
    """Tells the robots' states and hears their torques, each on the topics of its wiring.

    Torques are handed on once every robot has heard its own; in lockstep, once all answer the
    same state.

    Args:
        node: The team's node.
        team: The robots.
        take: Takes the torques of all, shape (n,) [N or N m], and the stamp of the state that
            they answer [ns], None where it was not told.
    """

    def __init__(self, node: ScenarioNode, team: Team, take: TakeCommand) -> None:
        self._node, self._team, self._take = node, team, take
        self._timeout = np.inf if node.lockstep else node.scenario.general.command_timeout
        self._heard = np.zeros(team.n)
        self._listeners: list[_Listener] = []
        self._speakers: list[_Speaker] = []
        if not node.scenario.has_robot_state_topics:
            publisher = node.create_publisher(JointState, "joint_states", LOOP_QOS)
            codec = JointStateCodec(team.joint_names)
            self._speakers.append(_Speaker(slice(0, team.n), codec, publisher))
        rest = _Listener([], [])
        for index, robot in enumerate(team.robots):
            wiring = node.scenario.robots[robot.name].topics
            if wiring.joint_states_topic:
                self._add_speaker(index)
            if wiring.effort_topic:
                self._add_listener(index)
            else:
                part = team.velocity_slices[index]
                rest.names.append(robot.name)
                rest.joints += range(part.start, part.stop)
        if rest.names:
            self._listeners.append(rest)
            codec = JointStateCodec(team.joint_names, required=("effort",))
            hear = partial(self._on_commands, rest, codec)
            node.subscribe(JointState, "joint_commands", hear, raw=True)

    def _add_speaker(self, index: int) -> None:
        general, robot = self._node.scenario.general, self._team.robots[index]
        wiring = self._node.scenario.robots[robot.name].topics
        publisher = self._node.create_publisher(JointState, wiring.joint_states_topic, LOOP_QOS)
        codec = JointStateCodec(wiring.driver_joints(list(robot.model.names)[1:]))
        own_rate = wiring.joint_states_rate and not self._node.lockstep
        period = max(1, round(general.rate / wiring.joint_states_rate)) if own_rate else 1
        part = self._team.velocity_slices[index]
        # Robots of one rate do not all speak at once: real ones do not either.
        self._speakers.append(_Speaker(part, codec, publisher, period, index % period))

    def _add_listener(self, index: int) -> None:
        robot, part = self._team.robots[index], self._team.velocity_slices[index]
        wiring = self._node.scenario.robots[robot.name].topics
        listener = _Listener(
            [robot.name], list(range(part.start, part.stop)), wiring.gravity_compensated
        )
        codec = EffortCodec(wiring.effort_order(list(robot.model.names)[1:]))
        self._listeners.append(listener)
        hear = partial(self._on_efforts, listener, codec)
        self._node.subscribe(Float64MultiArray, wiring.effort_topic, hear)

    def _on_commands(self, listener: _Listener, codec: JointStateCodec, data: bytes) -> None:
        stamp, _, _, effort = codec.decode(data)
        assert effort is not None  # The codec requires it.
        self._hear(listener, stamp, effort[listener.joints])

    def _on_efforts(
        self, listener: _Listener, codec: EffortCodec, message: Float64MultiArray
    ) -> None:
        stamp, torque = codec.decode(message)
        if stamp is None and self._node.lockstep:
            raise InputError("in lockstep the label of its dimension must say what it answers")
        self._hear(listener, stamp, torque)

    def _hear(self, listener: _Listener, stamp: int | None, torque: Array) -> None:
        self._heard[listener.joints] = torque
        listener.stamp, listener.heard_at = stamp, time.monotonic()
        if any(other.heard_at == -np.inf for other in self._listeners):
            return
        if self._node.lockstep and any(other.stamp != stamp for other in self._listeners):
            return
        self._take(stamp, self._heard.copy())

    def applied(self, torque: Array, q: Array, v: Array) -> Array:
        """What the motors apply over a tick that begins at (q, v), shape (n,) [N or N m].

        Who compensates gravity adds it to what was heard; who has heard nothing for long brakes.
        """
        silent = self.silent()
        if not silent and not any(listener.compensated for listener in self._listeners):
            return torque
        result, gravity = torque.copy(), self._team.gravity(q)
        brake = gravity - self._team.brake_damping * v
        for listener in self._listeners:
            joints = listener.joints
            if listener.names[0] in silent:
                result[joints] = brake[joints]
            elif listener.compensated:
                result[joints] += gravity[joints]
        return result

    def silent(self) -> list[str]:
        """Robots whose torques have stopped coming."""
        limit = time.monotonic() - self._timeout
        late = [listener for listener in self._listeners if listener.heard_at < limit]
        return [name for listener in late for name in listener.names]

    def tell(self, stamp_ns: int, tick: int, joints: tuple[Array, Array, Array]) -> None:
        """Publishes the states of a tick: positions, velocities and torques, shape (n,) each."""
        for speaker in self._speakers:
            if tick % speaker.period == speaker.first:
                values = [array[speaker.part] for array in joints]
                speaker.publisher.publish(speaker.codec.encode(stamp_ns, *values))
