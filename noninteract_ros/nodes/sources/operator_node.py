# SPDX-License-Identifier: Apache-2.0
"""What the programs for people's devices share: where the subtask is, and the last words."""

import time
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped
from trajectory_msgs.msg import MultiDOFJointTrajectory

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.impedance import spread
from noninteract_ros.errors import InputError, ScenarioError, one_of
from noninteract_ros.nodes.common.node import LOOP_QOS, ScenarioNode
from noninteract_ros.nodes.messages.messages import Level, ParsedReference, SubtaskCodec
from noninteract_ros.nodes.sources.operator_messages import OperatorCodec
from noninteract_ros.sources.human.input_settings import OperatorSettings
from noninteract_ros.sources.human.input_shaping import DeadManSwitch, OperatorInput
from noninteract_ros.subtasks.reference import Reference

BOUNDS = ("max_velocity", "max_acceleration", "max_jerk")
LAST_WORDS = 5  # rates of zero before silence, should one be lost
STALE = 0.5  # [s] age of the desired value from which nobody can be led


class OperatorNode(ScenarioNode):
    """Speaks for the human, in wall time, while somebody holds the device; else it is silent.

    Whoever lets go says a rate of zero a few times; then the subtask is free for another device.
    Messages have no stamp: they hold from when the controller hears them.

    Args:
        name: Name of the node.
        kwargs: Passed on to `rclpy.node.Node`.

    Raises:
        ScenarioError: The operator's subtask is none, has several elements, or the workspace does
            not fit it.
    """

    def __init__(self, name: str, **kwargs: Any) -> None:
        super().__init__(name, **kwargs)
        self.settings = self.scenario.operator or OperatorSettings()
        subtask = self.settings.subtask
        stack = self.scenario.build_stack(self.scenario.build_team())
        if subtask not in stack.names:
            raise ScenarioError("operator.subtask", repr(subtask), one_of(stack.names, subtask))
        task = stack.subtasks[stack.names.index(subtask)]
        led = self.scenario.subtasks[subtask].input
        limits = np.array([spread(task, name, getattr(led, name)) for name in BOUNDS])
        self.input = OperatorInput(self.settings, task, limits)
        self.dead_man = DeadManSwitch(self.settings.hold_timeout)
        self._codec = SubtaskCodec(subtask, task.elements, task.axes, task.rotates)
        self._sayings = OperatorCodec(task)
        self._desired: bytes | None = None
        self._desired_at = -np.inf
        self._words = self._sent = 0
        self._rate_to = self.create_publisher(
            TwistStamped, f"{subtask}/human/target_twist", LOOP_QOS
        )
        self._target_to = self.create_publisher(
            PoseStamped, f"{subtask}/human/target_pose", LOOP_QOS
        )
        self.subscribe(MultiDOFJointTrajectory, f"{subtask}/desired", self._on_desired, raw=True)
        self.every(1.0 / self.settings.update_rate, self._on_timer)

    @property
    def has_loop(self) -> bool:
        """In lockstep too people have a time of their own, and all is done by callbacks."""
        return False

    def _on_desired(self, data: bytes) -> None:
        self._desired, self._desired_at = data, time.monotonic()

    def desired(self) -> Reference | None:
        """Where the subtask is led to now; None where that is not known."""
        if self._desired is None or time.monotonic() - self._desired_at > STALE:
            return None
        found = self._codec.decode(self._desired)
        if not isinstance(found, ParsedReference):
            return None
        still = np.zeros(self._codec.layout.dim)
        velocity = still if found.velocity is None else found.velocity
        acceleration = still if found.acceleration is None else found.acceleration
        return Reference(found.position, velocity, acceleration)

    def _on_timer(self) -> None:
        now = time.monotonic()
        desired = self.desired() if self.dead_man.is_held(now) else None
        if desired is not None:
            try:
                self.lead(now, desired)
                self._words = LAST_WORDS
                self._sent += 1
                return
            except InputError as error:
                self.refuse("the device", str(error))
        self.let_go()
        if self._words > 0:
            self._words -= 1
            self.say_rate(np.zeros(self._codec.layout.dim))

    def lead(self, now: float, desired: Reference) -> None:
        """Says what the device asks for, while it is held.

        Args:
            now: Monotonic time [s].
            desired: Desired motion of the subtask.
        """
        raise NotImplementedError

    def let_go(self) -> None:
        """Forgets what was held."""

    def say_rate(self, velocity: Array) -> None:
        """Publishes a rate, shape (p,)."""
        self._rate_to.publish(self._sayings.rate(velocity))

    def say_target(self, value: Array) -> None:
        """Publishes a set-point, shape (size,)."""
        self._target_to.publish(self._sayings.target(value))

    def status(self) -> tuple[Level, str, dict[str, object]]:
        """Whether the device is held and the team is there."""
        held = self.dead_man.is_held(time.monotonic())
        values: dict[str, object] = {
            "leads": self.settings.subtask,
            "messages sent": self._sent,
            "held": held,
        }
        if self.desired() is None:
            return Level.WARN, "waiting for a controller that says where the subtask is", values
        return Level.OK, "held" if held else "let go", values
