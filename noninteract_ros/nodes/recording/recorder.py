# SPDX-License-Identifier: Apache-2.0
"""The recorder: writes every message of a run, as it came over the wire, into an MCAP file."""

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
from noninteract_ros.nodes.recording.feed import RawSubscription
from noninteract_ros.reporting.recording.definitions import definition
from noninteract_ros.reporting.recording.run import FILE_NAME
from noninteract_ros.reporting.recording.writer import RunWriter

GLOBAL_TOPICS = ("/diagnostics", "/clock")
DESCRIPTION = "/robot_description"
POLL_PERIOD = 0.004
FLUSH_PERIOD = 0.5
STATUS_PERIOD = 1.0
SCAN_PERIOD = 0.2  # while topics still appear ...
CALM_SCAN_PERIOD = 1.0  # ... and after none has appeared for a while
CALM_SCANS = 10
QUIET_TIME = 0.05  # at the end: what is on its way arrives within this time of silence ...
LAST_CALL = 1.0  # ... but who keeps talking is not listened to for longer

PARAMETERS: dict[str, tuple[Any, str]] = {
    "output": ("", "MCAP file to write; empty: runs/<date and time>/run.mcap"),
    "overwrite": (False, "Whether a file that exists is replaced."),
    "scenario_file": ("", "Scenario (YAML) to keep in the recording; empty: none."),
    "topics": ([""], "Topics known beforehand: 'name type' each, such as 'joint_states "
               "sensor_msgs/msg/JointState'; nothing of them is missed."),
}  # fmt: skip


class RecorderNode(Node):
    """Records all topics of its namespace, `/diagnostics` and `/clock`.

    It is not meant for an executor: `run` (or `poll`, every few milliseconds) empties all
    subscriptions by hand, at a fraction of the cost.

    Args:
        scenario_file: What the parameter `scenario_file` is where nobody gives it.
        kwargs: Passed on to `rclpy.node.Node`.

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
        self._feeds: dict[str, RawSubscription] = {}
        self._skipped: dict[str, str] = {}
        self._state = "recording"
        self._calm_scans = 0
        self._next = dict.fromkeys(("scan", "flush", "status"), 0.0)
        known = [_known_topic(text) for text in self._value("topics") if text]
        scenario = self._scenario()
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        for name, type_name in known:
            self._subscribe_known(name, type_name)
        self.writer = RunWriter(self._path(), scenario, self._value("overwrite"))

    def run(self, stopped: Callable[[], bool]) -> None:
        """Records until told to stop, then finishes the file.

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
        """Writes down what has arrived and does what is due; returns how many messages came.

        Raises:
            RecordingError: The file cannot be written.
        """
        taken = sum(feed.drain(self.writer.add) for feed in self._feeds.values())
        if self._due("scan", SCAN_PERIOD if self._calm_scans < CALM_SCANS else CALM_SCAN_PERIOD):
            self._scan()
        if self._due("flush", FLUSH_PERIOD):
            self.writer.flush()
        if self._due("status", STATUS_PERIOD):
            self._publish_status()
        return taken

    def finish(self) -> None:
        """Takes what is still on its way and completes the file.

        Raises:
            RecordingError: The file cannot be written.
        """
        end = time.monotonic() + LAST_CALL
        quiet_since = time.monotonic()
        while time.monotonic() < min(end, quiet_since + QUIET_TIME):
            if sum(feed.drain(self.writer.add) for feed in self._feeds.values()):
                quiet_since = time.monotonic()
            time.sleep(POLL_PERIOD)
        self.writer.close()
        self._state = "finished"
        if self.context.ok():
            self._publish_status()

    @property
    def lost(self) -> int:
        """Messages that were sent to the recorder and never arrived."""
        return sum(feed.sequence.lost for feed in self._feeds.values())

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

    def _due(self, what: str, period: float) -> bool:
        now = time.monotonic()
        if now < self._next[what]:
            return False
        self._next[what] = now + period
        return True

    def _scan(self) -> None:
        """Looks for topics that are new."""
        self._calm_scans += 1
        for topic, (type_name, *_) in self.get_topic_names_and_types():
            ours = topic in GLOBAL_TOPICS or topic.startswith(
                f"{self.get_namespace().rstrip('/')}/"
            )
            # Without what the robots are, nobody can make anything of a run.
            ours = ours or topic.endswith(DESCRIPTION)
            if ours and topic not in self._feeds and topic not in self._skipped:
                self._calm_scans = 0
                self._subscribe(topic, type_name)
        for feed in self._feeds.values():
            feed.match_publishers()

    def _subscribe_known(self, name: str, type_name: str) -> None:
        try:
            validate_topic_name(name)
            self._subscribe(self.resolve_topic_name(name), type_name)
        except InvalidTopicNameException as error:
            reason = " ".join(str(error).split())  # It draws a pointer on lines of its own.
            raise RecordingError(f"parameter topics: {reason}") from error

    def _subscribe(self, topic: str, type_name: str) -> None:
        try:
            definition(type_name)
            self._feeds[topic] = RawSubscription(self, topic, type_name)
        except (InputError, RecordingError) as error:
            self._skipped[topic] = str(error)
            self.get_logger().warning(f"{topic} is not recorded: {error}")

    def _publish_status(self) -> None:
        late = sum(feed.sequence.late for feed in self._feeds.values())
        waits = [feed.longest_wait for feed in self._feeds.values()]
        values = {
            "file": self.writer.path,
            "messages": self.writer.messages,
            "bytes": self.writer.size,
            "topics": self.writer.topics,
            "lost": self.lost,
            "sent before the recorder": late,
            "longest wait [ms]": 1e3 * max(waits, default=0.0),
            "topics left out": len(self._skipped),
        }
        level = Level.OK if self._state in ("recording", "finished") else Level.ERROR
        if level == Level.OK and (self.lost or self._skipped):
            level = Level.WARN
        status = to_status(self.get_fully_qualified_name(), level, self._state, values)
        # Wall time, as that of the recorded messages; simulated time would need an executor.
        self._diagnostics.publish(to_diagnostics(time.time_ns(), [status]))


def _known_topic(text: str) -> tuple[str, str]:
    """Name and type in an entry of the parameter `topics`."""
    parts = text.split()
    if len(parts) != 2:
        raise RecordingError(f"parameter topics: found {text!r}, allowed: 'name type'")
    return parts[0], parts[1]


def main(args: Sequence[str] | None = None) -> int:
    """Records until SIGINT or SIGTERM; exit status 2 where the file cannot be written.

    Without `scenario_file`, the first parameter file of the command line counts as the scenario.
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
