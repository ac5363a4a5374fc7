# SPDX-License-Identifier: Apache-2.0
"""The sources' nodes: what they say ahead in lockstep, and at their rate in wall time."""

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


class Bench:
    """A source alone, whose states the test gives; it notes what the source says."""

    def __init__(self, ros: Ros, name: str, topic: str, element: str, **changes: Any) -> None:
        self.ros = ros
        self._states = JointStateCodec(JOINTS)
        self.codec = SubtaskCodec(topic.split("/")[0], [element], ["x", "y"])
        self.said: list[ParsedReference | Marker] = []
        self.ear = ros.ear(paper())
        ros.probe.create_subscription(
            MultiDOFJointTrajectory, f"{topic}/reference", self._note, 100, raw=True
        )
        self._publisher = ros.probe.create_publisher(JointState, "joint_states", 10)
        self.node = ros.make(name, paper(**changes))
        # Both publishers have both listeners: nothing is said unheard.
        until(lambda: self._publisher.get_subscription_count() == 2, "two listeners")
        until(lambda: all(p.get_subscription_count() for p in self._references()), "a listener")

    def _references(self) -> list[Any]:
        return [item for item in self.node.publishers if "reference" in item.topic_name]

    def _note(self, data: bytes) -> None:
        self.said.append(self.codec.decode(data))

    def state(self, stamp: int) -> None:
        zeros = np.zeros(4)
        self._publisher.publish(self._states.encode(stamp, zeros, zeros, zeros))

    def stamps(self) -> list[tuple[str, int]]:
        """What was said: references and markers with their stamps."""
        return [(type(item).__name__, item.stamp_ns) for item in list(self.said)]

    def expect(self, *stamps: tuple[str, int]) -> None:
        """Waits for exactly this to be said, and starts a new list."""
        until(lambda: len(self.said) >= len(stamps), lambda: f"{stamps}, not {self.stamps()}")
        assert self.stamps() == list(stamps)
        self.said.clear()


def reference(ms: int) -> tuple[str, int]:
    return ("ParsedReference", ms * MS)


def marker(ms: int) -> tuple[str, int]:
    return ("Marker", ms * MS)


def test_a_source_speaks_one_tick_ahead_and_says_when_it_will_be_silent(ros: Ros) -> None:
    """A marker covers the silence before the start; then each tick has its reference."""
    bench = Bench(ros, "haptic_emulator", "cooperative/human", "cooperative")
    bench.state(0)
    bench.expect(marker(49))
    for ms in range(1, 49):
        bench.state(ms * MS)
    bench.state(49 * MS)
    bench.expect(reference(50))
    bench.state(50 * MS)
    bench.expect(reference(51))


def test_a_slow_source_bridges_its_ticks_with_markers(ros: Ros) -> None:
    """At 100 Hz and 1 kHz: a reference, then a marker up to the tick before the next one."""
    bench = Bench(ros, "relative_planner", "relative/autonomy", "robot_1-robot_2")
    bench.state(0)
    bench.expect(reference(0), marker(9))
    for ms in range(1, 10):
        bench.state(ms * MS)
    bench.expect(reference(10), marker(19))


def test_what_holds_for_a_state_is_said_again_with_it(ros: Ros) -> None:
    """A controller that was started anew hears from each source what it waits for."""
    bench = Bench(ros, "relative_planner", "relative/autonomy", "robot_1-robot_2")
    bench.state(0)
    bench.expect(reference(0), marker(9))
    bench.state(0)
    bench.expect(reference(0), marker(9))
    bench.state(5 * MS)
    bench.state(5 * MS)
    bench.expect(marker(9))


def test_a_team_that_starts_anew_is_spoken_to_from_the_start(ros: Ros) -> None:
    """Time that goes back after a silence is a new run; without a silence it is refused."""
    bench = Bench(ros, "relative_planner", "relative/autonomy", "robot_1-robot_2")
    bench.state(700 * MS)
    bench.expect(reference(700), marker(709))
    bench.state(0)

    def begins_anew() -> bool:
        bench.state(0)
        return len(bench.said) >= 2

    def refusal() -> bool:
        return "goes back" in bench.ear.value("relative_planner", "last rejection")

    until(refusal, "the refusal")
    until(bench.ear.says("relative_planner", "no states from the team"), "the silence is noticed")
    until(begins_anew, "a new start")
    assert bench.stamps()[:2] == [reference(0), marker(9)]


def test_in_wall_time_a_source_speaks_while_the_team_is_there(ros: Ros) -> None:
    """References carry the source's clock and its own motion; they end with the states."""
    bench = Bench(
        ros,
        "haptic_emulator",
        "cooperative/human",
        "cooperative",
        lockstep=False,
        haptic={"update_rate": 100.0, "start_time": 0.0},
    )

    def team() -> bool:
        bench.state(ros.probe.get_clock().now().nanoseconds)
        return len(bench.said) >= 30

    until(team, "30 references")
    until(bench.ear.says("haptic_emulator", "no states from the team"), "the silence is noticed")
    count = len(bench.said)
    until(bench.ear.renewed("haptic_emulator"))
    assert len(bench.said) == count
    stamps = np.array([item.stamp_ns for item in bench.said]) / 1e9
    first = bench.said[0]
    assert isinstance(first, ParsedReference)
    np.testing.assert_allclose(first.position, [0.0, 1.0], atol=0.05)
    assert (np.diff(stamps) > 0.0).all()
    for item in bench.said:
        assert isinstance(item, ParsedReference)
        assert item.velocity is not None
        assert item.acceleration is not None
