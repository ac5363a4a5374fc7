# SPDX-License-Identifier: Apache-2.0
"""Node `recorder`: write all serialized messages of a run into an MCAP file."""

import sys
import time
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException, InvalidTopicNameException
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.validate_topic_name import validate_topic_name

from noninteract_ros.errors import InputError, NoninteractError, RecordingError
from noninteract_ros.nodes.common.parameter_files import files_of
from noninteract_ros.nodes.common.program import StopSignal, init
from noninteract_ros.nodes.messages.messages import Level, to_diagnostics, to_status
from noninteract_ros.nodes.recording.raw_subscription import RawSubscription
from noninteract_ros.reporting.recording.definitions import definition
from noninteract_ros.reporting.recording.run import FILE_NAME
from noninteract_ros.reporting.recording.writer import RunWriter

GLOBAL_TOPICS = ("/diagnostics", "/clock")
DESCRIPTION = "/robot_description"
POLL_PERIOD = 0.004  # [s]
FLUSH_PERIOD = 0.5  # [s]
STATUS_PERIOD = 1.0  # [s]
SCAN_PERIOD = 0.2  # [s] between searches for topics while new ones appear
IDLE_SCANS = 10  # searches without a new topic, after which they become rarer
IDLE_SCAN_PERIOD = 1.0  # [s] between searches then
QUIET_TIME = 0.05  # [s] without a message after a stop, which ends the recording
DRAIN_TIMEOUT = 1.0  # [s] after a stop, at which the recording ends at the latest

PARAMETERS: dict[str, tuple[Any, str]] = {
    "output": ("", "MCAP file to write; empty: runs/<date and time>/run.mcap."),
    "overwrite": (False, "Replace an existing file."),
    "scenario_file": ("", "Scenario (YAML) to store in the recording; empty: none."),
    "topics": ([""], "Topics to subscribe to at the start, each as 'name type', such as "
               "'joint_states sensor_msgs/msg/JointState'; none of their messages is missed."),
}  # fmt: skip


class RecorderNode(Node):
    """Recorder of all topics of its namespace, all robot descriptions, `/diagnostics`, `/clock`.

    The node needs no executor: `run`, or `poll` every few milliseconds, drains all subscriptions
    at a fraction of the cost.

    Args:
        scenario_file: Default of the parameter `scenario_file`.
        kwargs: Passed on to `rclpy.node.Node`.

    Attributes:
        writer: Writer of the file.

    Raises:
        RecordingError: The file exists or cannot be written, the scenario cannot be read, or a
            parameter is wrong.
    """

    def __init__(self, scenario_file: str = "", **kwargs: Any) -> None:
        kwargs.setdefault("namespace", "team")
        super().__init__("recorder", start_parameter_services=False, **kwargs)
        for name, (default, text) in PARAMETERS.items():
            value = scenario_file if name == "scenario_file" else default
            descriptor = ParameterDescriptor(description=text, read_only=True)
            self.declare_parameter(name, value, descriptor)
        self._raw_subscriptions: dict[str, RawSubscription] = {}
        self._skipped: dict[str, str] = {}
        self._state = "recording"
        self._idle_scans = 0
        self._next = dict.fromkeys(("scan", "flush", "status"), 0.0)
        known = [_known_topic(text) for text in self._value("topics") if text]
        scenario = self._scenario()
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        for name, type_name in known:
            self._subscribe_known(name, type_name)
        self.writer = RunWriter(self._path(), scenario, self._value("overwrite"))

    def run(self, stopped: Callable[[], bool]) -> None:
        """Record until `stopped` returns True, then finish the file.

        Raises:
            RecordingError: The file cannot be written.
        """
        try:
            while not stopped() and self.context.ok():
                self.poll()
                time.sleep(POLL_PERIOD)
            self.finish()
        except RecordingError as error:
            self._state = str(error)
            if self.context.ok():
                self._publish_status()
            raise

    def poll(self) -> int:
        """Write received messages and do periodic work; return the number of messages.

        Raises:
            RecordingError: The file cannot be written.
        """
        taken = sum(item.drain(self.writer.add) for item in self._raw_subscriptions.values())
        if self._is_due(
            "scan", SCAN_PERIOD if self._idle_scans < IDLE_SCANS else IDLE_SCAN_PERIOD
        ):
            self._scan()
        if self._is_due("flush", FLUSH_PERIOD):
            self.writer.flush()
        if self._is_due("status", STATUS_PERIOD):
            self._publish_status()
        return taken

    def finish(self) -> None:
        """Write messages that are still on their way, and finish the file.

        Raises:
            RecordingError: The file cannot be written.
        """
        end = time.monotonic() + DRAIN_TIMEOUT
        quiet_since = time.monotonic()
        while time.monotonic() < min(end, quiet_since + QUIET_TIME):
            if sum(item.drain(self.writer.add) for item in self._raw_subscriptions.values()):
                quiet_since = time.monotonic()
            time.sleep(POLL_PERIOD)
        self.writer.close()
        self._state = "finished"
        if self.context.ok():
            self._publish_status()

    @property
    def lost(self) -> int:
        """Number of messages that were sent to the recorder and never arrived."""
        return sum(item.sequence.lost for item in self._raw_subscriptions.values())

    def _value(self, name: str) -> Any:
        return self.get_parameter(name).value

    def _path(self) -> Path:
        given = self._value("output")
        now = datetime.now().strftime("%Y-%m-%d_%H-%M-%S")
        return Path(given) if given else Path("runs") / now / FILE_NAME

    def _scenario(self) -> str | None:
        file = self._value("scenario_file")
        try:
            return Path(file).read_text(encoding="utf-8") if file else None
        except (OSError, UnicodeDecodeError) as error:
            raise RecordingError(f"scenario_file {file}: cannot be read: {error}") from error

    def _is_due(self, task: str, period: float) -> bool:
        now = time.monotonic()
        if now < self._next[task]:
            return False
        self._next[task] = now + period
        return True

    def _scan(self) -> None:
        """Subscribe to new topics and match the QoS of all publishers."""
        self._idle_scans += 1
        for topic, (type_name, *_) in self.get_topic_names_and_types():
            selected = topic in GLOBAL_TOPICS or topic.startswith(
                f"{self.get_namespace().rstrip('/')}/"
            )
            # A run cannot be evaluated without the descriptions of its robots.
            selected = selected or topic.endswith(DESCRIPTION)
            if selected and topic not in self._raw_subscriptions and topic not in self._skipped:
                self._idle_scans = 0
                self._subscribe(topic, type_name)
        for item in self._raw_subscriptions.values():
            item.match_publishers()

    def _subscribe_known(self, name: str, type_name: str) -> None:
        try:
            validate_topic_name(name)
            self._subscribe(self.resolve_topic_name(name), type_name)
        except InvalidTopicNameException as error:
            reason = " ".join(
                str(error).split()
            )  # The text has several lines, with a pointer to the character.
            raise RecordingError(f"parameter topics: {reason}") from error

    def _subscribe(self, topic: str, type_name: str) -> None:
        try:
            definition(type_name)
            self._raw_subscriptions[topic] = RawSubscription(self, topic, type_name)
        except (InputError, RecordingError) as error:
            self._skipped[topic] = str(error)
            self.get_logger().warning(f"{topic} is not recorded: {error}")

    def _publish_status(self) -> None:
        missed = sum(item.sequence.missed for item in self._raw_subscriptions.values())
        waits = [item.longest_wait for item in self._raw_subscriptions.values()]
        values = {
            "file": self.writer.path,
            "messages": self.writer.messages,
            "bytes": self.writer.size,
            "topics": self.writer.topics,
            "lost": self.lost,
            "sent before the recorder": missed,
            "longest wait [ms]": 1e3 * max(waits, default=0.0),
            "topics left out": len(self._skipped),
        }
        level = Level.OK if self._state in ("recording", "finished") else Level.ERROR
        if level == Level.OK and (self.lost or self._skipped):
            level = Level.WARN
        status = to_status(self.get_fully_qualified_name(), level, self._state, values)
        # Wall time, like the recorded messages; simulated time would need an executor.
        self._diagnostics.publish(to_diagnostics(time.time_ns(), [status]))


def _known_topic(text: str) -> tuple[str, str]:
    """Return name and type of an entry of the parameter `topics`."""
    parts = text.split()
    if len(parts) != 2:
        raise RecordingError(f"parameter topics: found {text!r}, allowed: 'name type'")
    return parts[0], parts[1]


def main(args: Sequence[str] | None = None) -> int:
    """Record until SIGINT or SIGTERM; return 2 if the file cannot be written, else 0.

    The default of `scenario_file` is the first parameter file of the command line.
    """
    stop = StopSignal()
    argv = list(sys.argv if args is None else args)
    try:
        init(argv, SignalHandlerOptions.NO)
        node = RecorderNode(next(iter(files_of(argv)), ""))
        node.run(lambda: stop.received)
        writer = node.writer
        lost = f", {node.lost} lost" if node.lost else ""
        print(f"{writer.path}: {writer.messages} messages on {writer.topics} topics{lost}")
    except (NoninteractError, InvalidParameterTypeException) as error:
        print(f"recorder: {error}", file=sys.stderr)
        return 2
    finally:
        rclpy.try_shutdown()
    return 0
