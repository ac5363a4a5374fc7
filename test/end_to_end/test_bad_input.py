# SPDX-License-Identifier: Apache-2.0
"""Invalid messages on any topic do not change a run."""

import itertools
import math
import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, Transform, Twist, TwistStamped, WrenchStamped
from harness import Ros, Stack, paper
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint
from waiting import until

from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.rehearsal import rehearse

FAR = 10**6  # [s]
JOINTS = ["robot_1/x", "robot_1/y", "robot_2/x", "robot_2/y"]
Spoil = Callable[[Any], None]


def setting(path: str, value: Any) -> Spoil:
    """Return a function that sets a nested attribute of a message."""

    def spoil(message: Any) -> None:
        *owners, name = path.split(".")
        for owner in owners:
            message = message[int(owner)] if owner.isdigit() else getattr(message, owner)
        setattr(message, name, value)

    return spoil


STAMPS = {
    "goes back|answers no state": setting("header.stamp.nanosec", 1),
    "ahead|answers no state": setting("header.stamp.sec", FAR),
    "is not a time": setting("header.stamp.nanosec", 2**31 + 1),
}
FRAME = {"frame 'moon' is unknown": setting("header.frame_id", "moon")}


def joint_kinds(names: tuple[str, ...]) -> dict[str, Spoil]:
    first = names[0]
    kinds = {
        "joint 'robot_9/x' is unknown": setting("name", ["robot_9/x", *JOINTS[1:]]),
        "is missing": setting("name", JOINTS[:3]),
        "is given twice": setting("name", [*JOINTS, "robot_1/x"]),
        f"{first} has 3 numbers": setting(first, [0.0] * 3),
        f"{first} of robot_1/x is nan": setting(first, [math.nan, 0.0, 0.0, 0.0]),
        f"{first} of robot_2/y is -inf": setting(first, [0.0, 0.0, 0.0, -math.inf]),
        f"{first} is missing": setting(first, []),
    }
    return kinds | STAMPS


def wrench_kinds() -> dict[str, Spoil]:
    numbers = {
        "force y is nan": setting("wrench.force.y", math.nan),
        "torque z is inf": setting("wrench.torque.z", math.inf),
    }
    return FRAME | STAMPS | numbers


def reference_kinds(element: str) -> dict[str, Spoil]:
    point = MultiDOFJointTrajectoryPoint()
    points = {
        "is unknown": setting("joint_names", ["robot_9"]),
        "is missing": setting("joint_names", []),
        "is given twice": setting("joint_names", [element, element]),
        "2 points": setting("points", [point, point]),
        "2 transforms": setting("points.0.transforms", [Transform(), Transform()]),
        "0 transforms": setting("points.0.transforms", []),
        "3 velocities": setting("points.0.velocities", [Twist()] * 3),
        "accelerations without velocities": setting("points.0.velocities", []),
        "time_from_start": setting("points.0.time_from_start.sec", 1),
        "x of .* is nan": setting("points.0.transforms.0.translation.x", math.nan),
        "velocity y of .* is inf": setting("points.0.velocities.0.linear.y", math.inf),
        "acceleration angular z": setting("points.0.accelerations.0.angular.z", math.nan),
        "not a unit quaternion": setting("points.0.transforms.0.rotation.w", 0.0),
    }

    def marker_ahead(message: Any) -> None:
        message.points, message.header.stamp.sec = [], FAR

    # A marker that is believed would end the wait for its source.
    return FRAME | STAMPS | points | {"s is .* ahead, allowed: 1 s": marker_ahead}


POSE_KINDS = (
    FRAME
    | STAMPS
    | {
        "y is inf": setting("pose.position.y", math.inf),
        "not a unit quaternion": setting("pose.orientation.w", 2.0),
        "rotation x is nan": setting("pose.orientation.x", math.nan),
    }
)
TWIST_KINDS = (
    FRAME
    | STAMPS
    | {
        "x is nan": setting("twist.linear.x", math.nan),
        "inf": setting("twist.angular.x", math.inf),
    }
)


def joint_state(**arrays: list[float]) -> JointState:
    return JointState(name=JOINTS, **arrays)


def reference(element: str) -> MultiDOFJointTrajectory:
    point = MultiDOFJointTrajectoryPoint()
    point.transforms, point.velocities, point.accelerations = [Transform()], [Twist()], [Twist()]
    return MultiDOFJointTrajectory(joint_names=[element], points=[point])


def topics() -> Iterator[tuple[str, str, type, Callable[[], Any], dict[str, Spoil]]]:
    """Yield node, topic, type, factory of valid messages, and ways to spoil them by reason."""
    zeros = [0.0] * 4
    states = joint_kinds(("position",))
    for node in ("controller", "haptic_emulator", "relative_planner"):
        kinds = states if node == "controller" else dict(list(states.items())[:6]) | STAMPS
        make = lambda: joint_state(position=zeros, velocity=zeros)  # noqa: E731
        yield node, "joint_states", JointState, make, kinds
    commands = joint_kinds(("effort",))
    yield "robot_team", "joint_commands", JointState, lambda: joint_state(effort=zeros), commands
    wrench = wrench_kinds()
    yield "robot_team", "robot_1/push", WrenchStamped, WrenchStamped, wrench
    yield "controller", "robot_2/external_wrench", WrenchStamped, WrenchStamped, wrench
    yield "haptic_emulator", "cooperative/feedback", WrenchStamped, WrenchStamped, wrench
    elements = {"cooperative": "cooperative", "relative": "robot_1-robot_2"}
    for (subtask, element), source in itertools.product(elements.items(), ("human", "autonomy")):
        base = f"{subtask}/{source}"
        make = lambda element=element: reference(element)  # noqa: E731
        kinds = reference_kinds(element)
        yield "controller", f"{base}/reference", MultiDOFJointTrajectory, make, kinds
        yield "controller", f"{base}/target_pose", PoseStamped, PoseStamped, POSE_KINDS
        yield "controller", f"{base}/target_twist", TwistStamped, TwistStamped, TWIST_KINDS
        yield "controller", f"{base}/wrench", WrenchStamped, WrenchStamped, wrench


class InvalidPublisher:
    """Publisher of valid and invalid messages on one topic of a node.

    Args:
        stack: Running stack.
        node: Name of the node that must reject invalid messages.
        topic: Topic.
        message_type: Message type.
    """

    def __init__(self, stack: Stack, node: str, topic: str, message_type: type) -> None:
        self._stack, self._node, self._topic = stack, node, topic
        self._publisher = stack.ros.probe.create_publisher(message_type, topic, 10)

    def matched(self) -> bool:
        count = self._stack.ros.probe.count_subscribers(self._publisher.topic_name)
        return bool(self._publisher.get_subscription_count() == count)

    def publish(self, message: Any) -> None:
        self._publisher.publish(message)

    def rejections(self) -> int:
        values = self._stack.monitor.status.get(self._node, (0, "", {}))[2]
        return int(values.get(f"rejected on {self._topic}", 0))

    def expect_rejection(self, message: Any, reason: str) -> None:
        """Publish an invalid message, and wait until the node has rejected it for a reason."""
        before = self.rejections()
        self._publisher.publish(message)

        def rejected() -> bool:
            self._stack.nodes[self._node].publish_diagnostics()
            values = self._stack.monitor.status.get(self._node, (0, "", {}))[2]
            last = values.get("last rejection", "")
            named = last.startswith(f"{self._topic}: ") and re.search(reason, last)
            return self.rejections() > before and bool(named)

        until(rejected, f"{self._node} rejects {self._topic}: {reason}")


def harmless(topic: str) -> bool:
    """Return True if a valid message has no effect: it is zero, or without authority."""
    has_authority = topic.startswith(("cooperative/human", "relative/autonomy"))
    own = topic.startswith("joint") or topic.endswith(("external_wrench", "feedback"))
    return topic.endswith("/wrench") or not (has_authority or own)


def test_invalid_messages_have_no_effect(ros: Ros) -> None:
    """They are rejected, counted and reported; states equal those of a run without them."""
    values = paper(haptic={"hand_mass": 0.5}, lockstep_timeout=20.0)
    stack = ros.stack(values)
    publishers = [
        (InvalidPublisher(stack, *where), make, kinds) for *where, make, kinds in topics()
    ]
    until(lambda: all(item.matched() for item, *_ in publishers), "all subscribers matched")
    stack.start()
    stack.run_until(0.1)
    for (_, topic, *_), (publisher, make, kinds) in zip(topics(), publishers, strict=True):
        if harmless(topic):
            valid = make()
            valid.header.stamp.nanosec = 10**6
            publisher.publish(valid)
        for reason, spoil in kinds.items():
            invalid = make()
            spoil(invalid)
            publisher.expect_rejection(invalid, reason)
    # Stamps of the team are ticks; those of the publishers are not, or are far ahead.
    own = {
        stamp: data
        for stamp, data in list(stack.monitor.states.items())
        if stamp % 10**6 == 0 and stamp < 10**9 * FAR
    }
    t, q, v, effort = stack.monitor.history(own)
    expected = rehearse(Scenario.from_dict(values), t[-1])
    np.testing.assert_array_equal(t[:-1], expected.t)
    np.testing.assert_array_equal(q[:-1], expected.q)
    np.testing.assert_array_equal(v[:-1], expected.v)
    np.testing.assert_array_equal(effort[1:], expected.torque)
