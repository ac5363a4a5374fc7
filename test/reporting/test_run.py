# SPDX-License-Identifier: Apache-2.0
"""`Run` reads messages as serialized by ROS."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Quaternion, Transform, Twist, Vector3, WrenchStamped
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, String
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from noninteract_ros.errors import RecordingError, ScenarioError
from noninteract_ros.nodes.common.parameter_files import dump
from noninteract_ros.reporting.recording.recorded import scenario_of
from noninteract_ros.reporting.recording.run import Run
from noninteract_ros.reporting.recording.writer import RunWriter
from noninteract_ros.scenario import Scenario
from noninteract_ros.team.models.planar_arm import PlanarArm
from noninteract_ros.team.models.urdf_text import urdf_text


def type_name(message: Any) -> str:
    package, _, _ = type(message).__module__.split(".")
    return f"{package}/msg/{type(message).__name__}"


def record(folder: Path, *messages: tuple[str, Any]) -> Run:
    """Record messages; message n is sent at n seconds and received half a second later."""
    with RunWriter(folder / "run.mcap", "rate: 1000.0") as writer:
        for number, (topic, message) in enumerate(messages):
            sent = number * 10**9
            data = message if isinstance(message, bytes) else serialize_message(message)
            name = "sensor_msgs/msg/JointState" if data is message else type_name(message)
            writer.add(topic, name, sent + 5 * 10**8, sent, data)
    return Run.open(folder)


def stamped(message: Any, time: float) -> Any:
    message.header.stamp.sec = int(time)
    message.header.stamp.nanosec = round(time % 1 * 1e9)
    return message


def joints(time: float, names: list[str], **values: list[float]) -> JointState:
    return stamped(JointState(name=names, **values), time)


def vector(values: Any) -> Vector3:
    x, y, z = (float(value) for value in values)
    return Vector3(x=x, y=y, z=z)


def trajectory(
    time: float, names: list[str], values: Any, accelerations: bool
) -> MultiDOFJointTrajectory:
    """One point whose element k has the 19 numbers values[k]."""
    point = MultiDOFJointTrajectoryPoint()
    for row in np.asarray(values):
        x, y, z, w = (float(value) for value in row[3:7])
        rotation = Quaternion(x=x, y=y, z=z, w=w)
        point.transforms.append(Transform(translation=vector(row[:3]), rotation=rotation))
        twists = [
            Twist(linear=vector(row[at : at + 3]), angular=vector(row[at + 3 : at + 6]))
            for at in (7, 13)
        ]
        point.velocities.append(twists[0])
        if accelerations:
            point.accelerations.append(twists[1])
    message = MultiDOFJointTrajectory(joint_names=names, points=[point])
    return stamped(message, time)


def labelled(labels: list[str], data: list[float]) -> Float64MultiArray:
    message = Float64MultiArray(data=data)
    message.layout.dim = [MultiArrayDimension(label=label) for label in labels]
    return message


def test_joint_states_come_back_exactly(tmp_path: Path) -> None:
    """Stamps, names and all numbers are as sent, for all lengths of names."""
    rng = np.random.default_rng(1)
    for length in range(1, 9):
        names = ["a" * length, "b"]
        values = rng.standard_normal((20, 3, 2))
        sent = [
            joints(
                0.001 * k,
                names,
                position=row[0].tolist(),
                velocity=row[1].tolist(),
                effort=row[2].tolist(),
            )
            for k, row in enumerate(values)
        ]
        folder = tmp_path / str(length)
        found = record(folder, *(("/team/joint_states", item) for item in sent)).joints(
            "joint_states"
        )
        assert found.names == tuple(names)
        np.testing.assert_array_equal(found.position, values[:, 0])
        np.testing.assert_array_equal(found.velocity, values[:, 1])
        np.testing.assert_array_equal(found.effort, values[:, 2])
        np.testing.assert_allclose(found.stamps, 0.001 * np.arange(20), rtol=0, atol=1e-12)


def test_missing_fields_and_names_are_nan(tmp_path: Path) -> None:
    """Each name has one column, NaN where a message lacks it or has a wrong size."""
    found = record(
        tmp_path,
        ("/c", joints(1.0, ["a", "b"], effort=[1.0, 2.0])),
        ("/c", joints(2.0, ["b", "c"], effort=[3.0, 4.0], position=[5.0, 6.0])),
        ("/c", joints(3.0, ["a", "b"], effort=[7.0])),
    ).joints("/c")
    nan = np.nan
    assert found.names == ("a", "b", "c")
    np.testing.assert_array_equal(found.effort, [[1, 2, nan], [nan, 3, 4], [nan, nan, nan]])
    np.testing.assert_array_equal(found.position, [[nan] * 3, [nan, 5, 6], [nan] * 3])
    assert np.isnan(found.velocity).all()


def test_of_equal_stamps_the_first_message_counts(tmp_path: Path) -> None:
    """A repeated state appears once."""
    found = record(
        tmp_path,
        *(("/s", joints(t, ["a"], position=[p])) for t, p in [(1, 1.0), (1, 9.0), (2, 2.0)]),
    ).joints("s")
    np.testing.assert_array_equal(found.stamps, [1.0, 2.0])
    np.testing.assert_array_equal(found.position[:, 0], [1.0, 2.0])


def test_trajectories_come_back_exactly(tmp_path: Path) -> None:
    """Poses, twists and accelerations of each element are as sent."""
    rng = np.random.default_rng(2)
    values = rng.standard_normal((6, 3, 19))
    names = ["robot_1-robot_2", "x", "yy"]
    found = record(
        tmp_path,
        *(
            ("/team/relative/state", trajectory(k, names, row, accelerations=k % 2 == 0))
            for k, row in enumerate(values)
        ),
    ).trajectory("relative/state")
    assert found.names == tuple(names)
    np.testing.assert_array_equal(found.stamps, np.arange(6.0))
    np.testing.assert_array_equal(found.translation, values[..., :3])
    np.testing.assert_array_equal(found.quaternion, values[..., 3:7])
    np.testing.assert_array_equal(found.linear_velocity, values[..., 7:10])
    np.testing.assert_array_equal(found.angular_velocity, values[..., 10:13])
    np.testing.assert_array_equal(found.linear_acceleration[::2], values[::2, :, 13:16])
    np.testing.assert_array_equal(found.angular_acceleration[::2], values[::2, :, 16:])
    assert np.isnan(found.linear_acceleration[1::2]).all()


def test_markers_are_kept_apart(tmp_path: Path) -> None:
    """A message without points adds no value, but its stamp is known."""
    marker = stamped(MultiDOFJointTrajectory(joint_names=["e"]), 0.25)
    values = np.arange(19.0)[None]
    run = record(
        tmp_path,
        ("/r", marker),
        ("/r", trajectory(0.5, ["e"], values, accelerations=True)),
        ("/r", marker),
        ("/markers", marker),
    )
    found = run.trajectory("/r")
    np.testing.assert_array_equal(found.stamps, [0.5])
    np.testing.assert_array_equal(found.markers, [0.25])
    np.testing.assert_array_equal(found.translation, values[None, :, :3])
    assert run.trajectory("/markers").translation.shape == (0, 1, 3)


def test_wrenches_come_back_exactly(tmp_path: Path) -> None:
    """Force, torque and frame are as sent."""
    values = np.random.default_rng(3).standard_normal((4, 6))
    sent = []
    for k, row in enumerate(values):
        message = stamped(WrenchStamped(), k)
        message.header.frame_id = "world" if k < 2 else "tool"
        message.wrench.force, message.wrench.torque = vector(row[:3]), vector(row[3:])
        sent.append(("/push", message))
    found = record(tmp_path, *sent).wrench("push")
    assert found.frames == ("world", "world", "tool", "tool")
    np.testing.assert_array_equal(found.force, values[:, :3])
    np.testing.assert_array_equal(found.torque, values[:, 3:])


def test_labelled_numbers_are_found_by_label(tmp_path: Path) -> None:
    """The entry `time` is the stamp at any position; otherwise the time of publication."""
    run = record(
        tmp_path,
        ("/e", labelled(["storage", "time", "tank"], [1.0, 0.125, 2.0])),
        ("/e", labelled(["storage", "time", "tank"], [3.0, 0.25, 4.0])),
        ("/e", labelled(["storage", "time", "tank"], [9.0, 0.25, 9.0])),
        ("/plain", labelled(["storage"], [5.0])),
    )
    found = run.labelled("/e")
    assert found.labels == ("storage", "tank")
    np.testing.assert_array_equal(found.stamps, [0.125, 0.25])
    np.testing.assert_array_equal(found["tank"], [2.0, 4.0])
    np.testing.assert_array_equal(run.labelled("/plain").stamps, [3.0])
    with pytest.raises(KeyError, match="storage"):
        found["storag"]


def test_diagnostics_are_dictionaries(tmp_path: Path) -> None:
    """Each status becomes one dictionary, its values by key."""
    status = DiagnosticStatus(level=DiagnosticStatus.ERROR, name="controller", message="stopped")
    status.values = [KeyValue(key="rate", value="1000")]
    message = stamped(DiagnosticArray(status=[status, DiagnosticStatus(name="x")]), 1.5)
    first, second = record(tmp_path, ("/diagnostics", message)).diagnostics()
    assert first == {
        "stamp": 1.5,
        "name": "controller",
        "level": 2,
        "message": "stopped",
        "hardware_id": "",
        "values": {"rate": "1000"},
    }
    assert second["name"] == "x"


def test_fast_decoding_agrees_with_the_general_decoder(tmp_path: Path) -> None:
    """On texts of all lengths, numpy at offsets reads what field-by-field decoding reads."""
    rng = np.random.default_rng(4)
    sent = []
    for k in range(60):
        names = ["n" * int(rng.integers(1, 9)) + str(i) for i in range(rng.integers(0, 4))]
        count = len(names) if k % 3 else 0
        message = joints(k, names, velocity=rng.standard_normal(count).tolist())
        message.header.frame_id = "f" * int(rng.integers(0, 9))
        sent.append(("/s", message))
    run = record(tmp_path, *sent)
    found = run.joints("/s")
    for row, message in zip(found.velocity, run.messages("/s"), strict=True):
        columns = [found.names.index(name) for name in message.name]
        expected = list(message.velocity) or [np.nan] * len(columns)
        np.testing.assert_array_equal(row[columns], expected)
        assert np.isnan(np.delete(row, columns)).all()


def test_scenario_topics_and_times(tmp_path: Path) -> None:
    """A run has scenario, topic types, and times of publication and reception."""
    run = record(tmp_path, ("/a", joints(0, ["a"])), ("/a", joints(1, ["a"])))
    assert run.scenario == "rate: 1000.0"
    assert run.topics == {"/a": "sensor_msgs/msg/JointState"}
    np.testing.assert_array_equal(run.publish_times("a"), [0, 10**9])
    np.testing.assert_array_equal(run.log_times("a"), [5 * 10**8, 15 * 10**8])


def test_the_teams_topics_come_before_those_of_its_robots(tmp_path: Path) -> None:
    """A name without namespace selects the topic nearest to the root."""
    topics = ("/team/left/joint_states", "/team/joint_states", "/team/right/joint_states")
    run = record(tmp_path, *((topic, joints(0, [topic[6]])) for topic in topics))
    assert list(run.joints("joint_states").names) == ["j"]
    assert list(run.joints("right/joint_states").names) == ["r"]


def test_wrong_topics_are_named_with_the_right_ones(tmp_path: Path) -> None:
    """Missing, ambiguous and mistyped topics raise errors that list the alternatives."""
    run = record(tmp_path, *((topic, joints(0, ["a"])) for topic in ("/x/state", "/y/state")))
    with pytest.raises(RecordingError, match=r"/z is not in the recording.*/x/state \| /y/state"):
        run.joints("/z")
    with pytest.raises(RecordingError, match="state matches several topics"):
        run.joints("state")
    with pytest.raises(RecordingError, match="holds sensor_msgs/msg/JointState, not geometry"):
        run.wrench("x/state")


@pytest.mark.parametrize(
    "data", [b"", b"\0\1\0\0", b"\0\0\0\0" + bytes(40), b"\0\1" + b"\xff" * 60]
)
def test_a_malformed_message_is_named(tmp_path: Path, data: bytes) -> None:
    """Invalid bytes raise an error that names the message."""
    run = record(tmp_path, ("/a", joints(0, ["a"])), ("/a", data))
    with pytest.raises(RecordingError, match="/a: message 1"):
        run.joints("/a")


def test_invalid_files_are_rejected(tmp_path: Path) -> None:
    """Missing, empty, foreign and truncated files raise errors with the reason."""
    record(tmp_path, ("/a", joints(0, ["a"])))
    whole = (tmp_path / "run.mcap").read_bytes()
    path = tmp_path / "other.mcap"
    with pytest.raises(RecordingError, match="no such file"):
        Run.open(path)
    for content, reason in [
        (b"", "is empty"),
        (b"rate: 1000.0\n", "is not an MCAP file"),
        (whole[:-9], "noninteract repair"),
        (whole[: len(whole) // 2], "noninteract repair"),
    ]:
        path.write_bytes(content)
        with pytest.raises(RecordingError, match=reason):
            Run.open(path)


def test_the_recorded_description_replaces_a_missing_file(tmp_path: Path) -> None:
    """A scenario with URDF files is analysed by the descriptions that the team published."""
    block = PlanarArm(link_lengths=(0.5, 0.5), link_masses=(1.0, 1.0), mass_location="centre")
    description = urdf_text(block.build("arm"))
    arm = {"model": "urdf", "urdf": "moved.urdf", "tool_frame": "tool"}
    impedance = {"stiffness": [100.0], "damping": [40.0], "authority": "hold"}
    values: dict[str, Any] = {
        "robots": ["a", "b"],
        "a": {**arm, "initial_position": [1.4, -1.2]},
        "b": {**arm, "initial_position": [0.9, 1.2], "base_pose": [1, 0, 0, 0, 0, 0, 1]},
        "subtasks": ["lead", "gap"],
        "lead": {"kind": "cooperative_position", **impedance},
        "gap": {"kind": "relative_position", **impedance},
    }
    with RunWriter(tmp_path / "run.mcap", dump({"/**": {"ros__parameters": values}})) as writer:
        for robot in ("a", "b"):
            data = serialize_message(String(data=description))
            writer.add(f"/team/{robot}/robot_description", "std_msgs/msg/String", 1, 0, data)
    with pytest.raises(ScenarioError, match=r"moved\.urdf"):
        Scenario.from_dict(values)
    scenario = scenario_of(Run.open(tmp_path))
    assert scenario.team.n == 4
