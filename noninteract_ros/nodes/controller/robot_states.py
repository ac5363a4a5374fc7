# SPDX-License-Identifier: Apache-2.0
"""State of the team from the joint states of its robots."""

import threading
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from noninteract_ros.arrays import Array
from noninteract_ros.errors import InputError
from noninteract_ros.nodes.common.guarded_node import LOOP_QOS
from noninteract_ros.nodes.common.node import ScenarioNode
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

# Compatible with any driver; only the newest messages are kept.
DRIVER_QOS = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
StateCallback = Callable[[int, Array, Array], None]


class DriverStateCodec:
    """sensor_msgs/JointState of a driver: joints in any order, a subset, or with other joints.

    Messages of the same shape as the last one are read in place.

    Args:
        names: Driver names of the joints of the robot.
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
        """Return stamp [ns], joint indices in `names`, positions, velocities and efforts.

        Effort is NaN or None where the driver does not measure it. The result is None for a
        message without joints of the robot.

        Raises:
            InputError: The bytes are not a JointState, a joint is given twice, position or
                velocity is missing or not finite, an array has a wrong size, or the stamp is not
                a time.
        """
        found = self._template.decode(data) if self._template else None
        if found is None:
            message = deserialize(data, JointState)
            self._set_layout(message)
            numbers = np.concatenate([getattr(message, name) for name in QUANTITIES])
            found = join_stamp(message.header.stamp.sec, message.header.stamp.nanosec), numbers
        if not self._joints.size:
            return None
        stamp, values = found
        ends = np.cumsum(self._sizes)
        rows = [values[end - size : end] for size, end in zip(self._sizes, ends, strict=True)]
        position, velocity = rows[0][self._columns], rows[1][self._columns]
        names = [self._names[joint] for joint in self._joints]
        check_finite(position, lambda i: f"position of {names[i]}")
        check_finite(velocity, lambda i: f"velocity of {names[i]}")
        effort = rows[2][self._columns] if self._sizes[2] else None
        return stamp, self._joints, position, velocity, effort

    def _set_layout(self, message: JointState) -> None:
        """Store the columns of the joints in messages of this shape."""
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
    """Subscriptions to the joint states of all robots, joined into states of the team.

    In lockstep, a state is reported once all robots have published the same stamp. In wall time,
    `poll` reports a state at the newest stamp of any robot; the others are predicted to it. A
    robot too old for prediction is awaited for `max_state_skew` more, since after a pause of the
    machine one robot is always received first. Then the state is reported with that robot at rest.

    Each state is also published on `joint_states` for the other nodes. Its efforts are measured
    ones; if a robot has none, they are the last commanded torques.

    Args:
        node: Controller node.
        team: Robot team.
        on_state: Called with each state of the team: stamp [ns], joint positions and velocities.

    Attributes:
        commanded: Last commanded torques, shape (n,) [N or N m].
        late: Names of the robots too old for prediction.
    """

    def __init__(self, node: ScenarioNode, team: Team, on_state: StateCallback) -> None:
        general = node.scenario.general
        self._node, self._team, self._callback = node, team, on_state
        self._max_skew = general.max_state_skew
        self._late_since: int | None = None
        self._assembler = StateAssembler(
            team.joint_names, general.state_prediction, general.max_state_skew
        )
        self._lock = threading.Lock()
        self._stamps = node.stamp_checker(lambda: None)
        self._codec = JointStateCodec(team.joint_names)
        self._publisher = node.create_publisher(JointState, "joint_states", LOOP_QOS)
        self.commanded = np.zeros(team.n)
        self.late: tuple[str, ...] = ()
        qos = LOOP_QOS if node.lockstep else DRIVER_QOS
        for robot, joints in zip(team.robots, team.velocity_slices, strict=True):
            topics = node.scenario.robots[robot.name].topics
            codec = DriverStateCodec(topics.driver_joints(list(robot.model.names)[1:]))
            topic = topics.joint_states_topic
            callback = partial(self._on_message, topic, codec, joints.start)
            node.subscribe(JointState, topic, callback, raw=True, qos=qos)

    def _on_message(self, topic: str, codec: DriverStateCodec, first: int, data: bytes) -> None:
        decoded = codec.decode(data)
        if decoded is None:
            return
        stamp, indices, position, velocity, effort = decoded
        joints = indices + first
        with self._lock:
            if not self._node.lockstep:
                # Unstamped messages use the current time.
                stamp = stamp or self._node.now_ns()
                if self._stamps.accept(f"{topic} {joints[0]}", stamp):
                    self._assembler.reset(joints)
            self._assembler.update(joints, stamp, position, velocity, effort)
            if not (self._node.lockstep and self._assembler.simultaneous):
                return
            state = self._assembler.assemble()
        self._publish(state)

    def poll(self) -> None:
        """Wall time: report a state of the team if a robot has published a new one."""
        with self._lock:
            state = self._assembler.assemble() if self._assembler.ready else None
        if state is None or self._should_wait(state):
            return
        parts = zip(self._team.names, self._team.velocity_slices, strict=True)
        self.late = tuple(name for name, part in parts if state.late[part].any())
        try:
            self._publish(state)
        except InputError as error:
            self._node.reject_input("joint_states", str(error))

    def _should_wait(self, state: AssembledState) -> bool:
        """Return True while late robots are still awaited."""
        if not state.late.any():
            self._late_since = None
            return False
        if self._late_since is None:
            self._late_since = state.stamp_ns
        return (state.stamp_ns - self._late_since) * 1e-9 <= self._max_skew

    def _publish(self, state: AssembledState) -> None:
        measured = np.isfinite(state.effort).all()
        effort = state.effort if measured else self.commanded
        self._publisher.publish(
            self._codec.encode(state.stamp_ns, state.position, state.velocity, effort)
        )
        self._callback(state.stamp_ns, state.position, state.velocity)

    def problem(self) -> str:
        """Return the error text of late robots, or ""."""
        if not self.late:
            return ""
        limit = 1e3 * self._max_skew
        return f"states of {', '.join(self.late)} are more than {limit:g} ms older than the others"

    def waiting_for(self) -> list[str]:
        """Return the robots of which not all joints have been received."""
        with self._lock:
            missing = self._assembler.missing
        return list(dict.fromkeys(name.partition("/")[0] for name in missing))
