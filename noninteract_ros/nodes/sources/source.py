# SPDX-License-Identifier: Apache-2.0
"""A program that speaks for one source of one subtask."""

import time

import numpy as np
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import MultiDOFJointTrajectory

from noninteract_ros.arrays import Array
from noninteract_ros.clock import seconds, tick_stamp
from noninteract_ros.errors import InputError
from noninteract_ros.nodes.common.lockstep import StampOrder, state_lead
from noninteract_ros.nodes.common.node import LOOP_QOS, ScenarioNode, Ticker
from noninteract_ros.nodes.messages.cdr import JointStateCodec
from noninteract_ros.nodes.messages.messages import Level, SubtaskCodec
from noninteract_ros.sources.announcements import Announcer, Sampler
from noninteract_ros.subtasks.reference import Reference


class SourceNode(ScenarioNode):
    """Publishes what a sampler says as references of a subtask.

    Lockstep: having seen the state of a tick it speaks ahead, for everything up to the next tick.
    Wall time: it speaks at its update rate, its time counted from the first state that it sees.
    """

    def speak_for(
        self, sampler: Sampler, subtask: str, source: str, update_rate: float, feels: bool = False
    ) -> None:
        """Sets the node up; called once, by the constructor.

        Args:
            sampler: Where the references come from.
            subtask: Subtask that they lead.
            source: `human` or `autonomy`.
            update_rate: Rate of references in wall time [Hz].
            feels: Whether the sampler waits for the subtask's feedback.
        """
        team = self.scenario.build_team()
        stack = self.scenario.build_stack(team)
        task = stack.subtasks[stack.names.index(subtask)]
        self._sampler, self._feels = sampler, feels
        self._codec = SubtaskCodec(subtask, task.elements, task.axes, task.rotates)
        self._joints = JointStateCodec(team.joint_names)
        self._rate, self._update_rate = self.scenario.general.rate, update_rate
        self._announcer = Announcer(sampler, self._rate)
        self._order, self._lead = StampOrder(), state_lead(self._rate)
        self._began: int | None = None
        self._stamp = -1
        self._state_at = -np.inf
        self._feedback: Array = np.zeros(task.dim)
        self._sent = 0
        self._words: list[tuple[int, bytes]] = []
        topic = f"{subtask}/{source}/reference"
        self._publish_to = self.create_publisher(MultiDOFJointTrajectory, topic, LOOP_QOS)
        self.subscribe(JointState, "joint_states", self._on_state, raw=True)
        if feels:
            self.subscribe(WrenchStamped, f"{subtask}/feedback", self._on_feedback)

    def _on_state(self, data: bytes) -> None:
        stamp = self._joints.decode(data).stamp_ns
        if self._order.take("joint_states", stamp, self._lead):
            self._begin_anew(stamp)
        self._state_at = time.monotonic()
        if stamp == self._stamp and self._began is not None:
            self._repeat()
            return
        self._words = [(until, words) for until, words in self._words if until >= stamp]
        if self._began is None:
            self._began = stamp
            self._announcer.reset(seconds(stamp))
            if self.lockstep:
                self._speak(seconds(stamp))
        self._stamp = stamp
        if self.lockstep and not self._feels:
            self._speak_ahead(stamp)

    def _begin_anew(self, stamp: int) -> None:
        """The team was started anew: what was felt and said belongs to its former life."""
        self._order.forget()
        self._order.note("joint_states", stamp)
        self._began = None
        self._words = []
        self._feedback = np.zeros_like(self._feedback)

    def _on_feedback(self, message: WrenchStamped) -> None:
        stamp, force = self._codec.force(message)
        if self.lockstep and stamp > self._stamp + 2e9 / self._rate:
            raise InputError(f"stamp {seconds(stamp):.6f} s answers no state of the team")
        self._order.take("feedback", stamp, self._lead)
        self._feedback = force
        if self.lockstep and self._began is not None:
            self._speak_ahead(stamp)

    def _speak_ahead(self, stamp: int) -> None:
        tick = round(seconds(stamp) * self._rate)
        self._speak(seconds(tick_stamp(tick + 1, self._rate)))

    def _speak(self, until: float) -> None:
        feedback = self._feedback if self._feels else None
        for stamp, reference in self._announcer.announce(until, feedback):
            if reference is None:
                words = self._codec.encode_marker(stamp)
            else:
                words = self._encode(stamp, reference)
            self._words.append((stamp, words))
            self._publish_to.publish(words)

    def _repeat(self) -> None:
        """Says again what holds for a state that was sent again: somebody did not hear it."""
        if not self.lockstep:
            return
        if not self._words:  # A hand has waited for a feedback that never came.
            self._speak(seconds(self._stamp))
            return
        for _, words in self._words:
            self._publish_to.publish(words)

    def _encode(self, stamp: int, reference: Reference) -> bytes:
        self._sent += 1
        return self._codec.encode(
            stamp, reference.position, reference.velocity, reference.acceleration
        )

    def loop(self) -> None:
        """Wall time: one reference per update period, while the team is there."""
        ticker = Ticker(self._update_rate)
        timeout = self.scenario.general.state_timeout
        while self.context.ok():
            ticker.wait()
            began = self._began
            if began is None or time.monotonic() - self._state_at > timeout:
                continue
            now = self.get_clock().now().nanoseconds
            feedback = self._feedback if self._feels else None
            reference = self._sampler.sample(seconds(now - began), feedback)
            if reference is not None:
                self._publish_to.publish(self._encode(now, reference))

    def status(self) -> tuple[Level, str, dict[str, object]]:
        """Whether the team is there, and what was sent."""
        values: dict[str, object] = {
            "references sent": self._sent,
            "state age [s]": time.monotonic() - self._state_at,
        }
        if self._began is None:
            return Level.WARN, "waiting for the first state of the team", values
        if time.monotonic() - self._state_at > 1.0:
            return Level.WARN, "no states of the team", values
        return Level.OK, "running", values
