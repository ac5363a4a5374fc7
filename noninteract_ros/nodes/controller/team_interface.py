# SPDX-License-Identifier: Apache-2.0
"""Interface of the controller to the team: states in, torques out."""

from sensor_msgs.msg import JointState

from noninteract_ros.arrays import Array
from noninteract_ros.control.tick import Tick
from noninteract_ros.nodes.common.efforts import EffortPublishers
from noninteract_ros.nodes.common.guarded_node import LOOP_QOS
from noninteract_ros.nodes.common.loop_input import LoopInput
from noninteract_ros.nodes.common.node import ScenarioNode
from noninteract_ros.nodes.common.publisher_binding import PublisherWatch
from noninteract_ros.nodes.controller.robot_states import RobotStates, StateCallback
from noninteract_ros.nodes.messages.cdr import JointStateCodec
from noninteract_ros.team.team import Team


class TeamInterface:
    """Topics of the team, or of each robot.

    `joint_commands` always has all torques, including those of robots with their own effort
    controllers.

    Args:
        node: Controller node.
        team: Robot team.
        on_state: Called with each state of the team: stamp [ns], joint positions and velocities
            (n,).

    Attributes:
        efforts: Publishers to the effort controllers of the robots.
        applied: Efforts of the newest state, shape (n,) [N or N m], or None.
        states: Wall time: states of the whole team, or None.
    """

    def __init__(self, node: ScenarioNode, team: Team, on_state: StateCallback) -> None:
        self._callback = on_state
        self.applied: Array | None = None
        self._codec = JointStateCodec(team.joint_names, required=("position", "velocity"))
        self._publisher = node.create_publisher(JointState, "joint_commands", LOOP_QOS)
        self.efforts = EffortPublishers(node, team)
        self._last = b""
        self._robots: RobotStates | None = None
        self.states: LoopInput | None = None
        if node.scenario.has_robot_state_topics:
            self._robots = RobotStates(node, team, on_state)
        elif node.lockstep:
            node.subscribe(JointState, "joint_states", self.receive, raw=True)
            node.publisher_watch = PublisherWatch(node, "joint_states")
        else:
            self.states = LoopInput(node, JointState, "joint_states")

    def receive(self, data: bytes) -> None:
        """Receive a serialized state of the team."""
        stamp, position, velocity, self.applied = self._codec.decode(data)
        assert position is not None  # The codec requires both.
        assert velocity is not None
        self._callback(stamp, position, velocity)

    def answer(self, stamp: int, tick: Tick) -> None:
        """Publish the torques of a tick, with the stamp [ns] of the state it answers."""
        if self._robots is not None:
            self._robots.commanded = tick.torque
        self.efforts.send(stamp, tick.torque, tick.state.g)
        self._last = self._codec.encode(stamp, effort=tick.torque)
        self._publisher.publish(self._last)

    def resend(self) -> None:
        """Publish the last answer again."""
        self.efforts.resend()
        self._publisher.publish(self._last)

    def poll(self) -> None:
        """Wall time: process received states; without states, fade the torques to gravity."""
        if self._robots is not None:
            self._robots.poll()
        elif self.states is not None:
            self.states.poll(self.receive)
        self.efforts.fade_to_gravity()

    def problem(self) -> str:
        """Return the reason why the team must be held, or ""."""
        if self._robots is not None:
            return self._robots.problem()
        return self.states.problem() if self.states else ""

    def waiting_for(self) -> list[str]:
        """Return the robots without a state, if each robot publishes its own."""
        return self._robots.waiting_for() if self._robots else []
