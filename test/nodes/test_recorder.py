# SPDX-License-Identifier: Apache-2.0
"""Recorder as a process, and its node in this process."""

import gc
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from waiting import DEADLINE, until

from noninteract_ros.errors import RecordingError
from noninteract_ros.nodes.common.descriptions import LATCHED_QOS
from noninteract_ros.nodes.recording.raw_subscription import SequenceCheck
from noninteract_ros.nodes.recording.recorder import RecorderNode
from noninteract_ros.reporting.recording.repair import repair
from noninteract_ros.reporting.recording.run import Run

WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])
DOMAIN = 60 + WORKER % 10
TICKS = 1000
TOPICS = ("joint_states", "joint_commands", "cooperative/state")

# Publishes three topics at 1 kHz, as in a run, and ends when all messages are acknowledged.
PUBLISHER = f"""
import time, rclpy
from rclpy.duration import Duration
from sensor_msgs.msg import JointState

rclpy.init()
node = rclpy.create_node("publisher", namespace="team")
publishers = [node.create_publisher(JointState, topic, 2000) for topic in {TOPICS!r}]
while not all(publisher.get_subscription_count() for publisher in publishers):
    time.sleep(0.01)
message = JointState(name=["robot_1/x", "robot_1/y"])
start = time.monotonic()
for tick in range({TICKS}):
    message.header.stamp.sec, message.header.stamp.nanosec = tick // 1000, tick % 1000 * 10**6
    for number, publisher in enumerate(publishers):
        message.position = [float(tick), float(number)]
        publisher.publish(message)
    if tick == 300:
        print("publishing", flush=True)
    time.sleep(max(0.0, start + 0.001 * (tick + 1) - time.monotonic()))
for publisher in publishers:
    publisher.wait_for_all_acked(Duration(seconds=5))
"""


@pytest.fixture
def start(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Return a function that starts Python processes in a separate domain."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(DOMAIN))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    started = []

    def run(*arguments: str) -> subprocess.Popen[str]:
        pipe = subprocess.PIPE
        command = [sys.executable, *arguments]
        started.append(subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True))
        return started[-1]

    yield run
    for process in started:
        process.kill()
        process.communicate()


def recorder_arguments(**parameters: object) -> list[str]:
    given = [item for key, value in parameters.items() for item in ("-p", f"{key}:={value}")]
    return ["-m", "noninteract_ros.nodes", "recorder", "--ros-args", *given]


@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM])
def test_all_messages_are_recorded_until_a_signal(
    start: Callable[..., subprocess.Popen[str]], tmp_path: Path, ending: signal.Signals
) -> None:
    """No message on three topics at 1 kHz is lost; a signal completes the file with status 0."""
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text("/**: {ros__parameters: {rate: 1000.0}}\n")
    path = tmp_path / "new" / "run.mcap"
    known = str([f"{topic} sensor_msgs/msg/JointState" for topic in TOPICS[:2]])
    recorder = start(*recorder_arguments(output=path, topics=known, scenario_file=scenario))
    publisher = start("-c", PUBLISHER)
    assert publisher.wait(DEADLINE) == 0
    assert recorder.poll() is None, recorder.communicate()
    recorder.send_signal(ending)
    out, error = recorder.communicate(timeout=DEADLINE)
    assert recorder.returncode == 0, error
    assert f"{path}: " in out
    run = Run.open(path.parent)
    assert run.scenario == scenario.read_text()
    for number, topic in enumerate(TOPICS):
        found = run.joints(f"/team/{topic}")
        np.testing.assert_array_equal(found.position[:, 0], np.arange(TICKS))
        assert (found.position[:, 1] == number).all()
        assert (run.log_times(topic) >= run.publish_times(topic)).all()
    status = [item for item in run.diagnostics() if item["name"] == "/team/recorder"][-1]
    assert (status["level"], status["message"]) == (0, "recording")
    assert (status["values"]["lost"], status["values"]["sent before the recorder"]) == ("0", "0")


def test_the_file_of_a_killed_recorder_can_be_repaired(
    start: Callable[..., subprocess.Popen[str]], tmp_path: Path
) -> None:
    """After SIGKILL during a run, all flushed messages are recovered."""
    path = tmp_path / "run.mcap"
    recorder = start(*recorder_arguments(output=path))
    publisher = start("-c", PUBLISHER)
    assert publisher.stdout is not None
    assert publisher.stdout.readline() == "publishing\n"
    until(lambda: path.stat().st_size >= 10_000, "a recording")
    recorder.kill()
    recorder.wait(DEADLINE)
    with pytest.raises(RecordingError, match="noninteract repair"):
        Run.open(path)
    assert not repair(path).intact
    ticks = Run.open(path).joints("joint_states").position[:, 0]
    np.testing.assert_array_equal(ticks, np.arange(len(ticks)))
    assert len(ticks) > 100


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        ({}, "run.mcap: file exists"),
        ({"output": "{}/run.mcap/run.mcap"}, "run.mcap/run.mcap: cannot be written"),
        ({"scenario_file": "{}/nothing.yaml"}, "nothing.yaml: cannot be read"),
        ({"topics": "[joint_states]"}, "parameter topics: found 'joint_states'"),
        ({"topics": "['a x/msg/X y']"}, "parameter topics: found 'a x/msg/X y'"),
        ({"topics": "['1/ x/msg/X']"}, "parameter topics: Invalid topic name"),
        ({"overwrite": "7"}, "overwrite"),
    ],
)
def test_an_invalid_parameter_is_reported_in_one_line(
    start: Callable[..., subprocess.Popen[str]],
    tmp_path: Path,
    parameters: dict[str, str],
    reason: str,
) -> None:
    """The program ends with status 2, and an existing file is unchanged."""
    (tmp_path / "run.mcap").write_bytes(b"existing")
    given = {"output": "{}/run.mcap"} | parameters
    recorder = start(
        *recorder_arguments(**{key: value.format(tmp_path) for key, value in given.items()})
    )
    _, error = recorder.communicate(timeout=DEADLINE)
    assert recorder.returncode == 2, error
    assert len(error.splitlines()) == 1
    assert reason in error
    assert (tmp_path / "run.mcap").read_bytes() == b"existing"


FULL_DISK = """
import resource, sys
from noninteract_ros.nodes.recording.recorder import main

resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, 30_000))
sys.exit(main())
"""


def test_a_full_disk_is_reported(
    start: Callable[..., subprocess.Popen[str]], tmp_path: Path
) -> None:
    """The program ends with status 2 and one line, and the file can be repaired."""
    path = tmp_path / "run.mcap"
    recorder = start("-c", FULL_DISK, *recorder_arguments(output=path)[3:])
    start("-c", PUBLISHER)
    _, error = recorder.communicate(timeout=DEADLINE)
    assert recorder.returncode == 2
    assert error.splitlines() == [f"recorder: {path}: cannot be written: File too large"]
    assert repair(path).messages > 0


@pytest.fixture
def ros() -> Iterator[tuple[Any, Callable[..., RecorderNode]]]:
    """Return a publishing node and a factory of recorders in a separate context."""
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=DOMAIN, signal_handler_options=SignalHandlerOptions.NO)
    nodes = [rclpy.create_node("publisher", namespace="team", context=context)]

    def make(path: Path, **parameters: Any) -> RecorderNode:
        values = {"output": str(path)} | parameters
        overrides = [Parameter(key, value=value) for key, value in values.items()]
        nodes.append(RecorderNode(context=context, parameter_overrides=overrides))
        return nodes[-1]

    yield nodes[0], make
    for node in nodes:
        node.destroy_node()
    nodes.clear()
    context.try_shutdown()
    gc.collect()
    context.destroy()


def poll_until(recorder: RecorderNode, done: Callable[[], bool]) -> None:
    def polled() -> bool:
        recorder.poll()
        return done()

    until(polled)


def test_only_topics_of_the_namespace_are_recorded(ros: Any, tmp_path: Path) -> None:
    """Topics are discovered while recording; those of other namespaces are ignored."""
    node, make = ros
    recorder = make(tmp_path / "run.mcap")
    own = node.create_publisher(JointState, "late/topic", 10)
    other = node.create_publisher(JointState, "/other/topic", 10)
    poll_until(recorder, lambda: own.get_subscription_count() > 0)
    other.publish(JointState())
    own.publish(JointState())
    poll_until(recorder, lambda: recorder.writer.topics == 2)
    recorder.finish()
    assert set(Run.open(tmp_path).topics) == {"/team/late/topic", "/diagnostics"}
    assert other.get_subscription_count() == 0


def test_best_effort_publishers_are_recorded(ros: Any, tmp_path: Path) -> None:
    """The subscription adapts its reliability to the publisher."""
    node, make = ros
    recorder = make(tmp_path / "run.mcap", topics=["sensor sensor_msgs/msg/JointState"])
    qos = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
    publisher = node.create_publisher(JointState, "sensor", qos)

    def recorded() -> bool:
        publisher.publish(JointState())
        return recorder.writer.topics == 2

    poll_until(recorder, recorded)
    recorder.finish()
    assert "/team/sensor" in Run.open(tmp_path).topics


def test_latched_messages_are_recorded(ros: Any, tmp_path: Path) -> None:
    """A latched message sent before the recorder, such as a robot description, is recorded."""
    node, make = ros
    qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_publisher(JointState, "latched", qos).publish(JointState(name=["a"]))
    recorder = make(tmp_path / "run.mcap")
    poll_until(recorder, lambda: recorder.writer.topics == 2)
    recorder.finish()
    assert "/team/latched" in Run.open(tmp_path).topics


def test_robot_descriptions_of_all_namespaces_are_recorded(ros: Any, tmp_path: Path) -> None:
    """A run contains the descriptions of its robots, from any publisher."""
    node, make = ros
    node.create_publisher(String, "/arm/robot_description", LATCHED_QOS).publish(String(data="x"))
    recorder = make(tmp_path / "run.mcap")
    poll_until(recorder, lambda: recorder.writer.topics == 2)
    recorder.finish()
    found = [message.data for message in Run.open(tmp_path).messages("/arm/robot_description")]
    assert found == ["x"]


def test_an_unknown_type_is_not_recorded(ros: Any, tmp_path: Path) -> None:
    """A message type that is not installed affects its topic only, and is reported."""
    node, make = ros
    recorder = make(
        tmp_path / "run.mcap",
        topics=["a nothing_msgs/msg/Nothing", "b sensor_msgs/msg/JointState"],
    )
    publisher = node.create_publisher(JointState, "b", 10)
    poll_until(recorder, lambda: publisher.get_subscription_count() > 0)
    publisher.publish(JointState())
    poll_until(recorder, lambda: recorder.writer.topics == 2)
    recorder.finish()
    run = Run.open(tmp_path)
    assert set(run.topics) == {"/team/b", "/diagnostics"}
    assert (
        run.diagnostics()[-1]["level"],
        run.diagnostics()[-1]["values"]["topics left out"],
    ) == (
        1,
        "1",
    )


@pytest.mark.parametrize(
    ("publishers", "numbers", "lost", "missed"),
    [
        (1, [1, 2, 3], 0, 0),
        (1, [4, 5, 6], 0, 3),
        (1, [1, 2, 6, 7, 9], 4, 0),
        (1, [1, 2, 3, 1, 2, 3], 0, 0),
        (1, [1, 2, 3, 1, 2, 5], 2, 0),
        (2, [1, 1, 2, 2, 3, 4, 3, 4], 0, 0),
        (2, [1, 2, 40, 3, 41, 42, 4], 0, 39),
        (2, [1, 2, 40, 3, 41, 44, 4], 2, 39),
    ],
)
def test_gaps_in_sequence_numbers_are_counted(
    publishers: int, numbers: list[int], lost: int, missed: int
) -> None:
    """Gaps count as lost, a first number above 1 as missed, a restart as neither."""
    check = SequenceCheck(lambda: publishers)
    for number in numbers:
        check.update(number)
    assert (check.lost, check.missed) == (lost, missed)
