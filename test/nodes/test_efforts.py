# SPDX-License-Identifier: Apache-2.0
"""Torques as Float64MultiArray, and joint states of drivers."""

from typing import Any

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from noninteract_ros.errors import InputError
from noninteract_ros.nodes.common.efforts import EffortCodec
from noninteract_ros.nodes.controller.robot_states import DriverStateCodec

STAMP = 1_763_790_000_123_456_789


def test_torques_are_in_the_order_of_the_controller() -> None:
    """The data are plain numbers, and the label has the stamp of the answered state."""
    codec = EffortCodec([2, 0, 1])
    for stamp in (0, STAMP):
        message = deserialize_message(
            codec.encode(stamp, np.array([1.5, -2.5, 3.5])), Float64MultiArray
        )
        assert list(message.data) == [3.5, 1.5, -2.5]
        assert (message.layout.dim[0].size, message.layout.dim[0].stride) == (3, 3)
        assert message.layout.data_offset == 0
        answered, torque = codec.decode(message)
        assert answered == stamp
        np.testing.assert_array_equal(torque, [1.5, -2.5, 3.5])


def test_an_array_without_a_label_has_no_stamp() -> None:
    """Such an array can be published from a terminal."""
    answered, torque = EffortCodec([1, 0]).decode(Float64MultiArray(data=[1.0, 2.0]))
    assert answered is None
    np.testing.assert_array_equal(torque, [2.0, 1.0])


@pytest.mark.parametrize(
    ("data", "expected"),
    [([1.0], "1 numbers for 2 joints"), ([1.0, float("nan")], "number 1 is nan")],
)
def test_invalid_arrays_are_rejected(data: list[float], expected: str) -> None:
    """The error has the reason."""
    with pytest.raises(InputError, match=expected):
        EffortCodec([0, 1]).decode(Float64MultiArray(data=data))


def state(**changes: Any) -> bytes:
    """Return a message of joint_state_broadcaster for an arm with a finger."""
    fields: dict[str, Any] = {
        "name": ["b", "finger", "a"],
        "position": [2.0, 0.04, 1.0],
        "velocity": [-2.0, float("nan"), -1.0],
        "effort": [float("nan"), 0.0, 7.0],
    }
    message = JointState(**(fields | changes))
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(STAMP, 10**9)
    message.header.frame_id = "base_link"
    return serialize_message(message)


def test_states_are_read_by_name() -> None:
    """Other joints are ignored; the first message reads as the following ones."""
    codec = DriverStateCodec(["a", "b", "c"])
    for data in (state(), state(), state(position=[5.0, 0.0, 4.0]), state()):
        decoded = codec.decode(data)
        assert decoded is not None
        stamp, joints, position, velocity, effort = decoded
        assert stamp == STAMP
        np.testing.assert_array_equal(joints, [1, 0])
        np.testing.assert_array_equal(velocity, [-2.0, -1.0])
        np.testing.assert_array_equal(effort, [np.nan, 7.0])
    np.testing.assert_array_equal(position, [2.0, 1.0])
    other = codec.decode(state(name=["c", "b", "d"], velocity=[0.0] * 3, effort=[]))
    assert other is not None
    np.testing.assert_array_equal(other[1], [2, 1])
    np.testing.assert_array_equal(other[2], [2.0, 0.04])
    assert other[4] is None


def test_messages_without_joints_of_the_robot_are_ignored() -> None:
    """A gripper may publish on the same topic, without velocities."""
    codec = DriverStateCodec(["a", "b"])
    gripper = {"name": ["finger"], "position": [0.0], "velocity": [], "effort": []}
    assert codec.decode(state(**gripper)) is None
    assert codec.decode(state(**gripper)) is None
    assert codec.decode(state()) is not None


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"velocity": []}, "velocity is missing"),
        ({"velocity": [float("nan"), 0.0, 0.0]}, "velocity of b is nan"),
        ({"position": [0.0, 0.0, float("inf")]}, "position of a is inf"),
        ({"position": [0.0, 0.0]}, "position has 2 numbers for 3 joints"),
        ({"name": ["b", "finger", "b"]}, "joint 'b' is given twice"),
    ],
)
def test_invalid_states_are_rejected(changes: dict[str, Any], expected: str) -> None:
    """The error has the name of the joint, and the next message is read as before."""
    codec = DriverStateCodec(["a", "b"])
    codec.decode(state())
    with pytest.raises(InputError, match=expected):
        codec.decode(state(**changes))
    assert codec.decode(state()) is not None
