# SPDX-License-Identifier: Apache-2.0
"""Base class of the nodes that publish the references of one source of one subtask."""

import time

import numpy as np
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import MultiDOFJointTrajectory

from noninteract_ros.arrays import Array
from noninteract_ros.clock import seconds, tick_stamp
from noninteract_ros.nodes.common.guarded_node import LOOP_QOS
from noninteract_ros.nodes.common.node import ScenarioNode
from noninteract_ros.nodes.common.wall_rate import WallRate
from noninteract_ros.nodes.messages.cdr import JointStateCodec
from noninteract_ros.nodes.messages.messages import Level, SubtaskCodec
from noninteract_ros.sources.announcements import Announcer, Sampler
from noninteract_ros.subtasks.reference import Reference


class SourceNode(ScenarioNode):
    """Node that publishes the samples of a sampler as references of a subtask.

    In lockstep it publishes, on receiving the state of a tick, all references up to the next tick.
    In wall time it publishes at its update rate; its time begins with the first state received.
    """

    def set_up_source(
        self,
        sampler: Sampler,
        subtask: str,
        source: str,
        update_rate: float,
        uses_feedback: bool = False,
    ) -> None:
        """Create publishers and subscriptions; called once by the constructor.

        Args:
            sampler: Sampler of the references.
            subtask: Name of the subtask.
            source: `human` or `autonomy`.
            update_rate: Rate of references in wall time [Hz].
            uses_feedback: True where the sampler needs the feedback of the subtask.
        """
        team, stack = self.scenario.team, self.scenario.stack
        task = stack.subtasks[stack.names.index(subtask)]
        self._sampler, self._uses_feedback = sampler, uses_feedback
        self._codec = SubtaskCodec(subtask, task.elements, task.axes, task.rotates)
        self._joints = JointStateCodec(team.joint_names)
        self._rate, self._update_rate = self.scenario.general.rate, update_rate
        self._announcer = Announcer(sampler, self._rate)
        self._stamps = self.stamp_checker(self._team_time)
        self._started_at: int | None = None
        self._stamp = -1
        self._state_received_at = -np.inf
        self._feedback: Array = np.zeros(task.dim)
        self._sent = 0
        self._pending: list[tuple[int, bytes]] = []
        topic = f"{subtask}/{source}/reference"
        self._publisher = self.create_publisher(MultiDOFJointTrajectory, topic, LOOP_QOS)
        self.subscribe(JointState, "joint_states", self._on_state, raw=True)
        if uses_feedback:
            self.subscribe(WrenchStamped, f"{subtask}/feedback", self._on_feedback)

    def _on_state(self, data: bytes) -> None:
        stamp = self._joints.decode(data).stamp_ns
        if self._stamps.accept_state("joint_states", stamp):
            self._restart(stamp)
        self._state_received_at = time.monotonic()
        if stamp == self._stamp and self._started_at is not None:
            self._resend()
            return
        self._pending = [item for item in self._pending if item[0] >= stamp]
        if self._started_at is None:
            self._started_at = stamp
            self._announcer.reset(seconds(stamp))
            if self.lockstep:
                self._publish_until(seconds(stamp))
        self._stamp = stamp
        if self.lockstep and not self._uses_feedback:
            self._publish_tick(stamp)

    def _team_time(self) -> int | None:
        """Return the stamp of the newest state [ns], or None before the first one."""
        return None if self._started_at is None else self._stamp

    def _restart(self, stamp: int) -> None:
        """Discard feedback and references of before the restart of the team."""
        self._stamps.reset()
        self._stamps.record("joint_states", stamp)
        self._started_at = None
        self._pending = []
        self._feedback = np.zeros_like(self._feedback)

    def _on_feedback(self, message: WrenchStamped) -> None:
        stamp, force = self._codec.force(message)
        # In lockstep the feedback may arrive before the state that it belongs to.
        lead = 2.0 / self._rate if self.lockstep else None
        self._stamps.accept("feedback", stamp, max_lead=lead)
        self._feedback = force
        if self.lockstep and self._started_at is not None:
            self._publish_tick(stamp)

    def _publish_tick(self, stamp: int) -> None:
        tick = round(seconds(stamp) * self._rate)
        self._publish_until(seconds(tick_stamp(tick + 1, self._rate)))

    def _publish_until(self, until: float) -> None:
        feedback = self._feedback if self._uses_feedback else None
        for stamp, reference in self._announcer.announce(until, feedback):
            if reference is None:
                data = self._codec.encode_marker(stamp)
            else:
                data = self._encode(stamp, reference)
            self._pending.append((stamp, data))
            self._publisher.publish(data)

    def _resend(self) -> None:
        """Publish the references for a state that was sent again, since a message was lost."""
        if not self.lockstep:
            return
        if not self._pending:  # The feedback of this state was lost.
            self._publish_until(seconds(self._stamp))
            return
        for _, data in self._pending:
            self._publisher.publish(data)

    def _encode(self, stamp: int, reference: Reference) -> bytes:
        self._sent += 1
        return self._codec.encode(
            stamp, reference.position, reference.velocity, reference.acceleration
        )

    def loop(self) -> None:
        """Wall time: publish one reference per update period while states are received."""
        rate = WallRate(self._update_rate)
        timeout = self.scenario.general.state_timeout
        while self.running:
            rate.sleep()
            started_at = self._started_at
            if started_at is None or time.monotonic() - self._state_received_at > timeout:
                continue
            now = self.get_clock().now().nanoseconds
            feedback = self._feedback if self._uses_feedback else None
            reference = self._sampler.sample(seconds(now - started_at), feedback)
            if reference is not None:
                self._publisher.publish(self._encode(now, reference))

    def status(self) -> tuple[Level, str, dict[str, object]]:
        """Return the age of the newest state and the number of references sent."""
        values: dict[str, object] = {
            "references sent": self._sent,
            "state age [s]": time.monotonic() - self._state_received_at,
        }
        if self._started_at is None:
            return Level.WARN, "waiting for the first state of the team", values
        if time.monotonic() - self._state_received_at > 1.0:
            return Level.WARN, "no states from the team", values
        return Level.OK, "running", values
