# SPDX-License-Identifier: Apache-2.0
"""Nothing that arrives on a topic or a service ends a program."""

from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, Transform, Twist, TwistStamped, WrenchStamped
from harness import Ros, paper
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_sensor_data
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint
from waiting import until

from noninteract_ros.errors import InputError, StepError
from noninteract_ros.nodes.messages.cdr import JointStateCodec, deserialize
from noninteract_ros.nodes.messages.messages import SubtaskCodec

JOINTS = ["robot_1/x", "robot_1/y"]
POINT = MultiDOFJointTrajectoryPoint(
    transforms=[Transform()], velocities=[Twist()], accelerations=[Twist()]
)
MESSAGES: tuple[Any, ...] = (
    MultiDOFJointTrajectory(
        header=Header(frame_id="world"), joint_names=["cooperative"], points=[POINT]
    ),
    JointState(name=JOINTS, position=[0.0, 1.0], velocity=[0.0, 1.0], effort=[0.0, 0.0]),
    PoseStamped(),
    TwistStamped(),
    WrenchStamped(),
    Header(),
    String(data="human"),
)
BYTES = [serialize_message(message) for message in MESSAGES]
SUBTASK = SubtaskCodec("cooperative", ["cooperative"], ("x", "y"), False)
STATES = JointStateCodec(JOINTS)


def test_a_failing_step_ends_the_program(ros: Ros, monkeypatch: pytest.MonkeyPatch) -> None:
    """An error inside the control step is no rejected input: it passes the guard."""
    node = ros.make("controller", paper())

    def fail(*_: object) -> None:
        raise ValueError("a defect")

    monkeypatch.setattr(node.core, "step", fail)
    q = node.core.team.q0
    with pytest.raises(StepError, match="a defect"):
        node._guard("joint_states", lambda: node._answer(0, q, np.zeros(node.core.team.n), None))
    assert node.rejections() == {}


def test_a_malformed_parameter_is_refused(ros: Ros) -> None:
    """A type that does not exist is refused by itself, and the clock cannot be changed."""
    node = ros.make("robot_team", paper(start_paused=True))
    wrong = ParameterMessage(name="rate", value=ParameterValue(type=200))
    clock = Parameter("use_sim_time", value=True).to_parameter_msg()
    for name in ("law", "rate", ""):
        wrong.name = name
        request = SetParameters.Request(parameters=[wrong, clock])
        results = ros.call(SetParameters, "robot_team/set_parameters", request).results
        assert [item.successful for item in results] == [False, False]
        assert results[1].reason.startswith("use_sim_time: ")
    request = SetParametersAtomically.Request(parameters=[wrong])
    service = "robot_team/set_parameters_atomically"
    assert not ros.call(SetParametersAtomically, service, request).result.successful
    values = node._rejected
    assert (values["set_parameters"], values[service]) == (3, 1)
    assert not node.get_parameter("use_sim_time").value


@pytest.mark.parametrize("length", [112, 120, 168, 176, 224, 227, 245])
def test_a_reference_of_the_wrong_length_is_refused(length: int) -> None:
    """A message that is cut or has more bytes is not read as one with fewer numbers."""
    data = BYTES[0]
    assert len(data) == 228
    SUBTASK.decode(data)
    with pytest.raises(InputError):
        SUBTASK.decode(data.ljust(length, b"\0")[:length])


@settings(
    max_examples=2000,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=list(HealthCheck),
)
@given(
    which=st.integers(0, len(BYTES) - 1),
    at=st.integers(0, 400),
    new=st.binary(max_size=16),
    removed=st.integers(0, 16),
    end=st.integers(0, 400),
)
def test_bytes(which: int, at: int, new: bytes, removed: int, end: int) -> None:
    """Changed bytes of each message of the controller are read as finite numbers or refused."""
    data = BYTES[which]
    data = (data[:at] + new + data[at + removed :])[: len(data) + 100 - end]
    try:
        if which == 0:
            parsed = SUBTASK.decode(data)
            assert np.isfinite(getattr(parsed, "position", 0.0)).all()
        elif which == 1:
            arrays = STATES.decode(data)[1:]
            assert all(np.isfinite(array).all() for array in arrays if array is not None)
        else:
            deserialize(data, type(MESSAGES[which]))
    except InputError:
        pass


def test_a_failing_callback_is_counted(ros: Ros) -> None:
    """An error that no check foresees is named in the diagnostics, and the node goes on."""
    node = ros.make("robot_team", paper(start_paused=True))

    def fail(message: String) -> None:
        raise ValueError(message.data)

    node.subscribe(String, "failing", fail)
    publisher = ros.probe.create_publisher(String, "failing", 10)
    ros.wait_for_subscribers(publisher)
    publisher.publish(String(data="unforeseen"))
    until(lambda: node._rejected["failing"] == 1, "the rejection")
    assert node._last_rejection == "failing: ValueError: unforeseen"


def test_publishers_of_other_qos_are_received_or_named(ros: Ros) -> None:
    """Best effort suffices for a push in wall time; a loop topic names what does not fit."""
    node = ros.make("robot_team", paper(lockstep=False, lockstep_sources=None))
    received: list[WrenchStamped] = []
    node.subscribe(WrenchStamped, "sensed", received.append)
    node.subscribe(String, "commanded", received.append)
    sensor = ros.probe.create_publisher(WrenchStamped, "sensed", qos_profile_sensor_data)
    ros.wait_for_subscribers(sensor)
    sensor.publish(WrenchStamped())
    until(lambda: received, "the wrench")
    ros.probe.create_publisher(String, "commanded", qos_profile_sensor_data)
    until(lambda: node.mismatches, "the mismatch")
    assert node.mismatches == {
        "commanded": "a publisher of commanded is not received: its reliability differs"
    }
