# SPDX-License-Identifier: Apache-2.0
"""States of robots that speak on topics of their own, made into those of the team."""

import threading
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from noninteract_ros.arrays import Array
from noninteract_ros.errors import InputError
from noninteract_ros.nodes.common.lockstep import StampOrder, state_lead
from noninteract_ros.nodes.common.node import LOOP_QOS, ScenarioNode
from noninteract_ros.nodes.messages.cdr import (
    QUANTITIES,
    CdrTemplate,
    JointStateCodec,
    check_finite,
    deserialize,
    join_stamp,
)
from noninteract_ros.team.state_assembler import AssembledState, StateAssembler
from noninteract_ros.team.team import Team

# Whatever a driver offers is taken; of what has not been read, the newest counts.
DRIVER_QOS = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
TakeState = Callable[[int, Array, Array], None]


class DriverStateCodec:
    """Reads sensor_msgs/JointState as drivers send it: any order, other joints too, or only some.

    Messages of the same shape as the last one are read in place.

    Args:
        names: Joints that count, as the driver calls them.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = tuple(names)
        self._template: CdrTemplate | None = None
        self._columns = np.zeros(0, dtype=np.intp)
        self._sizes = (0, 0, 0)
        self._joints = np.zeros(0, dtype=np.intp)

    def decode(
        self, data: bytes
    ) -> tuple[int, NDArray[np.intp], Array, Array, Array | None] | None:
        """Stamp [ns], places in `names` of the joints told of, their position, velocity, effort.

        Effort is NaN or None where the driver does not know it. The whole is None where no joint
        counts.

        Raises:
            InputError: The bytes are no JointState, a joint is given twice, position or velocity
                is missing or not finite, an array has a wrong size, the stamp is not a time.
        """
        found = self._template.decode(data) if self._template else None
        if found is None:
            message = deserialize(data, JointState)
            self._learn(message)
            numbers = np.concatenate([getattr(message, name) for name in QUANTITIES])
            found = join_stamp(message.header.stamp.sec, message.header.stamp.nanosec), numbers
        if not self._joints.size:
            return None
        stamp, values = found
        ends = np.cumsum(self._sizes)
        rows = [values[end - size : end] for size, end in zip(self._sizes, ends, strict=True)]
        position, velocity = rows[0][self._columns], rows[1][self._columns]
        told = [self._names[joint] for joint in self._joints]
        check_finite(position, lambda i: f"position of {told[i]}")
        check_finite(velocity, lambda i: f"velocity of {told[i]}")
        effort = rows[2][self._columns] if self._sizes[2] else None
        return stamp, self._joints, position, velocity, effort

    def _learn(self, message: JointState) -> None:
        """Notes where the joints stand in messages of this shape."""
        names = list(message.name)
        known = [name for name in names if name in self._names]
        if len(set(known)) < len(known):
            twice = next(name for name in known if known.count(name) > 1)
            raise InputError(f"joint {twice!r} is given twice")
        sizes = [len(getattr(message, kind)) for kind in QUANTITIES]
        for kind, size in zip(QUANTITIES, sizes, strict=True):
            optional = kind == "effort" or not known
            if size != len(names) and not (size == 0 and optional):
                text = f"has {size} numbers for {len(names)} joints" if size else "is missing"
                raise InputError(f"{kind} {text}")
        self._joints = np.array([self._names.index(name) for name in known], dtype=np.intp)
        self._columns = np.array([names.index(name) for name in known], dtype=np.intp)
        self._sizes = (sizes[0], sizes[1], sizes[2])
        self._template = CdrTemplate(message)


class RobotStates:
    """Listens to every robot and tells of the team.

    Lockstep: it tells once all robots have told of the same time. Wall time: `poll` tells of the
    newest time that any robot told of; the others are carried on to it. One that is too old for
    that is waited for as long again, since after a hitch of a machine somebody has to be heard
    first; then the team is told of with that robot at rest.

    What is told is published as `joint_states` too, for all other programs. Its efforts are those
    that the robots measured; where one has none, the torques that were asked for last.

    Args:
        node: The controller's node.
        team: The robots.
        take: Takes a state of the team: stamp [ns], joint positions and velocities.
    """

    def __init__(self, node: ScenarioNode, team: Team, take: TakeState) -> None:
        general = node.scenario.general
        self._node, self._team, self._take = node, team, take
        self._max_skew = general.max_state_skew
        self._late_since: int | None = None
        self._assembler = StateAssembler(
            team.joint_names, general.state_prediction, general.max_state_skew
        )
        self._lock = threading.Lock()
        self._order, self._lead = StampOrder(), state_lead(general.rate)
        self._codec = JointStateCodec(team.joint_names)
        self._publish_to = node.create_publisher(JointState, "joint_states", LOOP_QOS)
        self.asked = np.zeros(team.n)
        self.late: tuple[str, ...] = ()
        qos = LOOP_QOS if node.lockstep else DRIVER_QOS
        for robot, part in zip(team.robots, team.velocity_slices, strict=True):
            wiring = node.scenario.robots[robot.name].topics
            codec = DriverStateCodec(wiring.driver_joints(list(robot.model.names)[1:]))
            topic = wiring.joint_states_topic
            listen = partial(self._on_message, topic, codec, part.start)
            node.subscribe(JointState, topic, listen, raw=True, qos=qos)

    def _on_message(self, topic: str, codec: DriverStateCodec, first: int, data: bytes) -> None:
        told = codec.decode(data)
        if told is None:
            return
        stamp, places, position, velocity, effort = told
        joints = places + first
        with self._lock:
            if not self._node.lockstep:
                # Who gives no time is believed to speak of now.
                stamp = stamp or self._node.get_clock().now().nanoseconds
                if self._order.take(f"{topic} {joints[0]}", stamp, self._lead):
                    self._assembler.reset(joints)
            self._assembler.update(joints, stamp, position, velocity, effort)
            if not (self._node.lockstep and self._assembler.simultaneous):
                return
            state = self._assembler.assemble()
        self._tell(state)

    def poll(self) -> None:
        """Wall time: tells of the team, if a robot has told something new."""
        with self._lock:
            state = self._assembler.assemble() if self._assembler.ready else None
        if state is None or self._waits(state):
            return
        parts = zip(self._team.names, self._team.velocity_slices, strict=True)
        self.late = tuple(name for name, part in parts if state.late[part].any())
        try:
            self._tell(state)
        except InputError as error:
            self._node.refuse("joint_states", str(error))

    def _waits(self, state: AssembledState) -> bool:
        """Whether it is too early to go on without those who are late."""
        if not state.late.any():
            self._late_since = None
            return False
        if self._late_since is None:
            self._late_since = state.stamp_ns
        return (state.stamp_ns - self._late_since) * 1e-9 <= self._max_skew

    def _tell(self, state: AssembledState) -> None:
        known = np.isfinite(state.effort).all()
        effort = state.effort if known else self.asked
        self._publish_to.publish(
            self._codec.encode(state.stamp_ns, state.position, state.velocity, effort)
        )
        self._take(state.stamp_ns, state.position, state.velocity)

    def problem(self) -> str:
        """Which robots are late, or an empty text."""
        if not self.late:
            return ""
        limit = 1e3 * self._max_skew
        return f"states of {', '.join(self.late)} are more than {limit:g} ms behind the others'"

    def waiting_for(self) -> list[str]:
        """Robots that have not told of all their joints yet."""
        with self._lock:
            unheard = self._assembler.missing
        return list(dict.fromkeys(name.partition("/")[0] for name in unheard))
