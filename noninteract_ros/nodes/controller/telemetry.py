# SPDX-License-Identifier: Apache-2.0
"""What the controller tells: subtask states, feedback to devices, energies, conditioning."""

from functools import partial

import numpy as np
from geometry_msgs.msg import WrenchStamped
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import MultiDOFJointTrajectory

from noninteract_ros.clock import seconds
from noninteract_ros.control.controller import TeamController
from noninteract_ros.control.telemetry.limit_activity import LimitActivity
from noninteract_ros.control.telemetry.subtask_energies import LABELS, rows
from noninteract_ros.control.tick import Tick
from noninteract_ros.nodes.common.lockstep import StampOrder, state_lead
from noninteract_ros.nodes.common.node import LOOP_QOS, ScenarioNode
from noninteract_ros.nodes.controller.team_energy import TeamEnergy, told, unsound
from noninteract_ros.nodes.messages.messages import EnergyCodec, SubtaskCodec, external_wrench
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team


class Telemetry:
    """Publishes feedback to a human at every tick, everything else at the telemetry rate.

    A human who waits to take over, as a source that lockstep waits for, feels at every tick too.

    Args:
        node: The controller's node.
        team: The robots.
        stack: Their subtasks.

    Attributes:
        safety: What to tell of singularities and joint limits.
        wrenches: Newest wrenches on the tools, shape (N, 6) [N, N m]; zero where no sensor is.
    """

    def __init__(self, node: ScenarioNode, team: Team, stack: SubtaskStack) -> None:
        general = node.scenario.general
        self._team, self._stack = team, stack
        self._rate = general.rate
        self._period = max(1, round(general.rate / general.telemetry_rate))
        self._lockstep = node.lockstep
        self._answered = 0
        self._tick: Tick | None = None
        self.safety = LimitActivity(team.joint_names)
        self.wrenches = np.zeros((len(team.names), 6))
        self._order, self._lead = StampOrder(), state_lead(general.rate)
        self._wrench_stamps = dict.fromkeys(general.force_sensors, -1)
        for name in general.force_sensors:
            take = partial(self._on_wrench, name)
            node.subscribe(WrenchStamped, f"{name}/external_wrench", take)
        self._codecs = [
            SubtaskCodec(task.name, task.elements, task.axes, task.rotates)
            for task in stack.subtasks
        ]
        self._energy_codec = EnergyCodec(LABELS)
        self._team_energy = TeamEnergy(node)
        make = node.create_publisher
        names = stack.names
        motion = MultiDOFJointTrajectory
        self._state_to = [make(motion, f"{name}/state", LOOP_QOS) for name in names]
        self._desired_to = [make(motion, f"{name}/desired", LOOP_QOS) for name in names]
        self._energy_to = [make(Float64MultiArray, f"{name}/energy", LOOP_QOS) for name in names]
        # A hand that waits for what it feels, and is waited for, hears every tick.
        self._awaited = {
            i for i, name in enumerate(names) if f"{name}/human" in general.lockstep_sources
        }
        # A wrench has one element; a subtask with several edges has no device to be felt with.
        self._feedback_to = {
            i: make(WrenchStamped, f"{task.name}/feedback", LOOP_QOS)
            for i, task in enumerate(stack.subtasks)
            if len(task.elements) == 1
        }

    def _on_wrench(self, robot: str, message: WrenchStamped) -> None:
        stamp, wrench = external_wrench(message)
        self._order.take(robot, stamp, self._lead)
        self.wrenches[self._team.index(robot)] = wrench
        self._wrench_stamps[robot] = stamp

    def forget(self) -> None:
        """Forgets the wrenches that have come so far."""
        self._order.forget()
        self.safety.reset()
        self._team_energy.forget()
        self._wrench_stamps = dict.fromkeys(self._wrench_stamps, -1)

    def missing(self, stamp: int) -> list[str]:
        """Wrenches that belong to the tick with this stamp [ns] and have not come yet."""
        tick = round(seconds(stamp) * self._rate)
        if tick % self._period:
            return []
        stamps = self._wrench_stamps.items()
        return [f"{name}/external_wrench" for name, heard in stamps if heard < stamp]

    def publish(self, stamp: int, core: TeamController, tick: Tick) -> None:
        """Tells of a tick, stamped as the state that it answered [ns]."""
        self._tick = tick
        self.safety.note(seconds(stamp), tick)
        slices = self._stack.slices
        count = round(seconds(stamp) * self._rate) if self._lockstep else self._answered
        due = count % self._period == 0
        self._answered += 1
        for i, publisher in self._feedback_to.items():
            if due or i in self._awaited or tick.led[i].source == "human":
                feedback = tick.feedback[slices[i]]
                publisher.publish(self._codecs[i].encode_wrench(stamp, feedback))
        if not due:
            return
        energy = core.energy(tick, self._team.external_torque(tick.state, self.wrenches))
        self._team_energy.publish(stamp, tick, core.outside.torque(tick.state, self.wrenches))
        accounts = rows(seconds(stamp), tick, energy, self.safety)
        for i, codec in enumerate(self._codecs):
            wanted, values = tick.led[i].reference, self._stack.value_slices[i]
            actual = codec.encode(stamp, tick.task.x[values], tick.x_rate[slices[i]])
            self._state_to[i].publish(actual)
            self._desired_to[i].publish(
                codec.encode(stamp, wanted.position, wanted.velocity, wanted.acceleration)
            )
            self._energy_to[i].publish(self._energy_codec.encode(accounts[i]))

    def condition(self) -> dict[str, object]:
        """Smallest singular value of the stacked Jacobian, tracking errors, shares of the law."""
        if self._tick is None:
            return {}
        values: dict[str, object] = {
            "smallest singular value": float(
                np.linalg.svd(self._tick.task.J, compute_uv=False)[-1]
            )
        }
        for name, part in zip(self._stack.names, self._stack.slices, strict=True):
            values[f"{name} error"] = float(np.abs(self._tick.error.e[part]).max())
        values |= self.safety.values()
        return values | told(self._tick.account)

    def problem(self) -> str:
        """What is wrong with the energy account, or an empty text."""
        return unsound(self._tick.account) if self._tick else ""
