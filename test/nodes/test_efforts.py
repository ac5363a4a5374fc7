# SPDX-License-Identifier: Apache-2.0
"""Torques as Float64MultiArray, and states as drivers tell them."""

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


def test_torques_stand_in_the_controllers_order_beside_the_stamp() -> None:
    """Any reader of the message finds the numbers; ours finds the stamp too."""
    codec = EffortCodec([2, 0, 1])
    for stamp in (0, STAMP):
        message = deserialize_message(
            codec.encode(stamp, np.array([1.5, -2.5, 3.5])), Float64MultiArray
        )
        assert list(message.data) == [3.5, 1.5, -2.5]
        assert (message.layout.dim[0].size, message.layout.dim[0].stride) == (3, 3)
        assert message.layout.data_offset == 0
        told, torque = codec.decode(message)
        assert told == stamp
        np.testing.assert_array_equal(torque, [1.5, -2.5, 3.5])


def test_a_bare_array_says_no_stamp() -> None:
    """As a person at a terminal sends it."""
    told, torque = EffortCodec([1, 0]).decode(Float64MultiArray(data=[1.0, 2.0]))
    assert told is None
    np.testing.assert_array_equal(torque, [2.0, 1.0])


@pytest.mark.parametrize(
    ("data", "expected"),
    [([1.0], "1 numbers for 2 joints"), ([1.0, float("nan")], "number 1 is nan")],
)
def test_wrong_arrays_are_refused(data: list[float], expected: str) -> None:
    """Whole, with the reason."""
    with pytest.raises(InputError, match=expected):
        EffortCodec([0, 1]).decode(Float64MultiArray(data=data))


def state(**changes: Any) -> bytes:
    """What joint_state_broadcaster might tell of an arm with a finger."""
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


def test_states_are_read_by_name_from_any_message() -> None:
    """Other joints do not count, whatever they hold; the first message reads as the next ones."""
    codec = DriverStateCodec(["a", "b", "c"])
    for data in (state(), state(), state(position=[5.0, 0.0, 4.0]), state()):
        told = codec.decode(data)
        assert told is not None
        stamp, joints, position, velocity, effort = told
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


def test_messages_of_other_joints_alone_do_not_count() -> None:
    """A gripper that speaks on the same topic, without velocities, disturbs nobody."""
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
def test_wrong_states_are_refused(changes: dict[str, Any], expected: str) -> None:
    """Whole, with the name of the joint; what comes next is read as ever."""
    codec = DriverStateCodec(["a", "b"])
    codec.decode(state())
    with pytest.raises(InputError, match=expected):
        codec.decode(state(**changes))
    assert codec.decode(state()) is not None
