# SPDX-License-Identifier: Apache-2.0
"""Where the controller's states come from, and where its torques go."""

from sensor_msgs.msg import JointState

from noninteract_ros.arrays import Array
from noninteract_ros.control.tick import Tick
from noninteract_ros.nodes.common.efforts import EffortOutputs
from noninteract_ros.nodes.common.node import LOOP_QOS, ScenarioNode
from noninteract_ros.nodes.controller.robot_states import RobotStates, TakeState
from noninteract_ros.nodes.messages.cdr import JointStateCodec
from noninteract_ros.team.team import Team


class TeamLink:
    """The team's topics, or those of each robot.

    `joint_commands` always tells all torques, those of robots with effort controllers of their
    own too.

    Args:
        node: The controller's node.
        team: The robots.
        take: Takes a state of the team: stamp [ns], joint positions and velocities (n,).

    Attributes:
        efforts: The robots' own effort controllers.
        applied: Torque that the newest state tells, shape (n,) [N or N m], or None.
    """

    def __init__(self, node: ScenarioNode, team: Team, take: TakeState) -> None:
        self._take = take
        self.applied: Array | None = None
        self._codec = JointStateCodec(team.joint_names, required=("position", "velocity"))
        self._publish_to = node.create_publisher(JointState, "joint_commands", LOOP_QOS)
        self.efforts = EffortOutputs(node, team)
        self._last = b""
        self._robots: RobotStates | None = None
        if node.scenario.has_robot_state_topics:
            self._robots = RobotStates(node, team, take)
        else:
            node.subscribe(JointState, "joint_states", self._on_state, raw=True)

    def _on_state(self, data: bytes) -> None:
        stamp, position, velocity, self.applied = self._codec.decode(data)
        assert position is not None  # The codec requires both.
        assert velocity is not None
        self._take(stamp, position, velocity)

    def answer(self, stamp: int, tick: Tick) -> None:
        """Tells the torques that answer the state with a stamp [ns]."""
        if self._robots is not None:
            self._robots.asked = tick.torque
        self.efforts.send(stamp, tick.torque, tick.state.g)
        self._last = self._codec.encode(stamp, effort=tick.torque)
        self._publish_to.publish(self._last)

    def repeat(self) -> None:
        """Tells the last answer again."""
        self.efforts.repeat()
        self._publish_to.publish(self._last)

    def poll(self) -> None:
        """Wall time: takes what the robots have told; without states, lets torques fade."""
        if self._robots is not None:
            self._robots.poll()
        self.efforts.rest()

    def problem(self) -> str:
        """Why the team has to be held still, or an empty text."""
        return self._robots.problem() if self._robots else ""

    def waiting_for(self) -> list[str]:
        """Robots that have not spoken yet, where each speaks for itself."""
        return self._robots.waiting_for() if self._robots else []
