# SPDX-License-Identifier: Apache-2.0
"""Messages of subtasks that rotate: orientations, angular velocities and torques."""

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from rclpy.serialization import deserialize_message, serialize_message
from trajectory_msgs.msg import MultiDOFJointTrajectory

from noninteract_ros.errors import InputError
from noninteract_ros.nodes.messages import cdr, messages
from noninteract_ros.nodes.messages.messages import SubtaskCodec

STAMP = 3_000_000_007
POSE = SubtaskCodec("cooperative", ["cooperative"], ("x", "y", "z"), rotates=True)
PAIRS = SubtaskCodec("relative", ["a-b", "b-c"], ("z", "x"), rotates=True)
TURN = SubtaskCodec("turn", ["turn"], (), rotates=True)
Q, OTHER = [0.6, 0.0, 0.0, 0.8], [0.0, 0.0, -1.0, 0.0]
VALUES = {
    POSE: np.array([1.0, 2.0, 3.0, *Q]),
    PAIRS: np.array([1.0, 2.0, *Q, 3.0, 4.0, *OTHER]),
    TURN: np.array(Q),
}


def motion(codec: SubtaskCodec, orders: int) -> list[np.ndarray]:
    """Return value, velocity, acceleration, all numbers of the rates different."""
    dim = codec.layout.dim
    return [VALUES[codec], 10.0 + np.arange(dim), 30.0 + np.arange(dim)][:orders]


@pytest.mark.parametrize("orders", [1, 2, 3])
@pytest.mark.parametrize("codec", VALUES, ids=lambda codec: codec.name)
def test_encoded_references_are_decoded_exactly(codec, orders, monkeypatch):
    """The values are the same in place and by the middleware."""
    expected = motion(codec, orders)
    data = codec.encode(STAMP, *expected)
    message = deserialize_message(data, MultiDOFJointTrajectory)
    found = [codec.reference(message)]
    monkeypatch.setattr(cdr, "deserialize_message", None)
    found += [codec.decode(data), codec.decode(serialize_message(message))]
    for item in found:
        rows = [item.position, item.velocity, item.acceleration]
        for row, array in zip(rows[:orders], expected, strict=True):
            np.testing.assert_array_equal(row, array)
        assert rows[orders:] == [None] * (3 - orders)


def test_rotations_and_angular_rates_are_placed_by_element():
    """Quaternions are the rotations of transforms, angular rates those of twists."""
    message = deserialize_message(PAIRS.encode(STAMP, *motion(PAIRS, 3)), MultiDOFJointTrajectory)
    (point,) = message.points
    moves = [(t.translation.x, t.translation.y, t.translation.z) for t in point.transforms]
    assert moves == [(2, 0, 1), (4, 0, 3)]
    turns = [(t.rotation.x, t.rotation.y, t.rotation.z, t.rotation.w) for t in point.transforms]
    assert turns == [tuple(Q), tuple(OTHER)]
    second = point.velocities[1]
    assert (second.linear.x, second.linear.y, second.linear.z) == (16, 0, 15)
    assert (second.angular.x, second.angular.y, second.angular.z) == (17, 18, 19)
    assert point.accelerations[0].angular.z == 34


def test_quaternions_are_normalized():
    """A quaternion of nearly unit length is normalized; others are rejected."""
    data = POSE.encode(STAMP, np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.6, 0.8004]))
    found = POSE.decode(data).position
    assert np.linalg.norm(found[3:]) == pytest.approx(1.0, abs=1e-15)
    data = POSE.encode(STAMP, np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.6, 0.9]))
    with pytest.raises(InputError, match="rotation of cooperative is not a unit quaternion"):
        POSE.decode(data)


def test_single_inputs_have_orientations_and_torques():
    """Set-points, rates and wrenches of a pose are read completely."""
    target = PoseStamped()
    target.pose.position.z = 3.0
    orientation = target.pose.orientation
    orientation.x, orientation.y, orientation.z, orientation.w = Q
    np.testing.assert_array_equal(POSE.target(target)[1], [0.0, 0.0, 3.0, *Q])
    np.testing.assert_array_equal(TURN.target(target)[1], Q)
    rate = TwistStamped()
    rate.twist.linear.x, rate.twist.angular.y = 1.0, 2.0
    np.testing.assert_array_equal(POSE.rate(rate)[1], [1.0, 0.0, 0.0, 0.0, 2.0, 0.0])
    np.testing.assert_array_equal(TURN.rate(rate)[1], [0.0, 2.0, 0.0])
    wrench = messages.to_wrench_stamped(STAMP, np.arange(1.0, 7.0))
    np.testing.assert_array_equal(POSE.force(wrench)[1], np.arange(1.0, 7.0))
    np.testing.assert_array_equal(TURN.force(wrench)[1], [4.0, 5.0, 6.0])


def test_feedback_has_a_torque():
    """The feedback of a pose has a force and a torque."""
    for codec, expected in ((POSE, [1, 2, 3, 4, 5, 6]), (TURN, [0, 0, 0, 1, 2, 3])):
        feedback = np.arange(1.0, codec.layout.dim + 1.0)
        message = deserialize_message(codec.encode_wrench(STAMP, feedback), WrenchStamped)
        force, torque = message.wrench.force, message.wrench.torque
        assert [force.x, force.y, force.z, torque.x, torque.y, torque.z] == expected
        np.testing.assert_array_equal(codec.force(message)[1], feedback)
