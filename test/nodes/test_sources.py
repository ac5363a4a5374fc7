# SPDX-License-Identifier: Apache-2.0
"""Nodes of the sources: references ahead in lockstep, at the update rate in wall time."""

from typing import Any

import numpy as np
from harness import Ros, paper
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import MultiDOFJointTrajectory
from waiting import until

from noninteract_ros.nodes.messages.cdr import JointStateCodec
from noninteract_ros.nodes.messages.messages import Marker, ParsedReference, SubtaskCodec

JOINTS = ["robot_1/x", "robot_1/y", "robot_2/x", "robot_2/y"]
MS = 10**6


class SourceMonitor:
    """Source with states published by the test, and the references it publishes."""

    def __init__(self, ros: Ros, name: str, topic: str, element: str, **changes: Any) -> None:
        self.ros = ros
        self._states = JointStateCodec(JOINTS)
        self.codec = SubtaskCodec(topic.split("/")[0], [element], ["x", "y"])
        self.references: list[ParsedReference | Marker] = []
        self.monitor = ros.monitor(paper())
        ros.probe.create_subscription(
            MultiDOFJointTrajectory, f"{topic}/reference", self._on_reference, 1000, raw=True
        )
        self._publisher = ros.probe.create_publisher(JointState, "joint_states", 10)
        self.node = ros.make(name, paper(**changes))
        until(lambda: self._publisher.get_subscription_count() == 2, "two subscribers")
        ros.wait_for_subscribers(
            *(item for item in self.node.publishers if "reference" in item.topic_name)
        )

    def _on_reference(self, data: bytes) -> None:
        self.references.append(self.codec.decode(data))

    def state(self, stamp: int) -> None:
        zeros = np.zeros(4)
        self._publisher.publish(self._states.encode(stamp, zeros, zeros, zeros))

    def stamps(self) -> list[tuple[str, int]]:
        """Return types and stamps [ns] of the received references and markers."""
        return [(type(item).__name__, item.stamp_ns) for item in list(self.references)]

    def expect(self, *stamps: tuple[str, int]) -> None:
        """Wait for exactly these references and markers, and clear the list."""
        until(
            lambda: len(self.references) >= len(stamps), lambda: f"{stamps}, not {self.stamps()}"
        )
        self.ros.drain()
        assert self.stamps() == list(stamps)
        self.references.clear()


def reference(ms: int) -> tuple[str, int]:
    return ("ParsedReference", ms * MS)


def marker(ms: int) -> tuple[str, int]:
    return ("Marker", ms * MS)


def test_a_source_publishes_one_tick_ahead(ros: Ros) -> None:
    """A marker covers the time before the start; then each tick has its reference."""
    source = SourceMonitor(ros, "haptic_emulator", "cooperative/human", "cooperative")
    source.state(0)
    source.expect(marker(49))
    for ms in range(1, 49):
        source.state(ms * MS)
    source.state(49 * MS)
    source.expect(reference(50))
    source.state(50 * MS)
    source.expect(reference(51))


def test_a_slow_source_publishes_markers_between_references(ros: Ros) -> None:
    """At 100 Hz and 1 kHz a marker covers the ticks up to the next reference."""
    source = SourceMonitor(ros, "relative_planner", "relative/autonomy", "robot_1-robot_2")
    source.state(0)
    source.expect(reference(0), marker(9))
    for ms in range(1, 10):
        source.state(ms * MS)
    source.expect(reference(10), marker(19))


def test_references_are_resent_with_their_state(ros: Ros) -> None:
    """A restarted controller receives the references that it waits for."""
    source = SourceMonitor(ros, "relative_planner", "relative/autonomy", "robot_1-robot_2")
    source.state(0)
    source.expect(reference(0), marker(9))
    source.state(0)
    source.expect(reference(0), marker(9))
    source.state(MS)
    source.state(MS)
    source.expect(marker(9))


def test_references_restart_with_the_team(ros: Ros) -> None:
    """Stamps that go back after a silence are a restart; without a silence they are rejected."""
    source = SourceMonitor(ros, "relative_planner", "relative/autonomy", "robot_1-robot_2")
    source.state(700 * MS)
    source.expect(reference(700), marker(709))
    source.state(0)

    def restarted() -> bool:
        source.state(0)
        return len(source.references) >= 2

    def rejected() -> bool:
        return "goes back" in source.monitor.value("relative_planner", "last rejection")

    until(rejected, "the rejection")
    source.monitor.wait_for_status("relative_planner", "no states from the team")
    until(restarted, "the restart")
    assert source.stamps()[:2] == [reference(0), marker(9)]


def test_a_source_publishes_in_wall_time_while_it_receives_states(ros: Ros) -> None:
    """References have the clock and motion of the source, and end with the states."""
    source = SourceMonitor(
        ros,
        "haptic_emulator",
        "cooperative/human",
        "cooperative",
        lockstep=False,
        haptic={"update_rate": 100.0, "start_time": 0.0},
    )

    def publish_state() -> None:
        source.state(ros.probe.get_clock().now().nanoseconds)

    def received(count: int) -> bool:
        publish_state()
        return len(source.references) >= count

    until(lambda: received(30), "30 references")
    source.monitor.wait_for_status("haptic_emulator", "no states from the team")
    count = int(source.monitor.value("haptic_emulator", "references sent"))
    resumed = ros.probe.get_clock().now().nanoseconds
    until(lambda: received(count + 1), "references after the silence")
    assert source.references[count].stamp_ns > resumed
    stamps = np.array([item.stamp_ns for item in source.references]) / 1e9
    first = source.references[0]
    assert isinstance(first, ParsedReference)
    np.testing.assert_allclose(first.position, [0.0, 1.0], atol=0.05)
    assert (np.diff(stamps) > 0.0).all()
    for item in source.references:
        assert isinstance(item, ParsedReference)
        assert item.velocity is not None
        assert item.acceleration is not None
