# SPDX-License-Identifier: Apache-2.0
"""Topics published by the controller: subtask states, feedback, energies."""

import time
from collections.abc import Callable
from functools import partial

import numpy as np
from geometry_msgs.msg import WrenchStamped
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import MultiDOFJointTrajectory

from noninteract_ros.arrays import Array
from noninteract_ros.clock import seconds
from noninteract_ros.control.controller import TeamController
from noninteract_ros.control.energy.account import (
    QUANTITIES,
    EnergyAccount,
    model_error_text,
    quantities,
)
from noninteract_ros.control.telemetry.limit_activity import LimitActivity
from noninteract_ros.control.telemetry.subtask_energies import LABELS, rows
from noninteract_ros.control.tick import Tick
from noninteract_ros.nodes.common.guarded_node import LOOP_QOS
from noninteract_ros.nodes.common.node import NEWEST_QOS, ScenarioNode
from noninteract_ros.nodes.messages.messages import EnergyCodec, SubtaskCodec, external_wrench
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team

SENSOR_PERIODS = 5  # of wrenches, least silence that is a timeout
ACCOUNT_LABELS = ("time", *QUANTITIES)


class Telemetry:
    """Publishers of the controller and subscriptions to external wrenches.

    Feedback to a human in authority is published every tick, everything else at the telemetry
    rate. A lockstep source of a human also receives its feedback every tick, since it waits for
    it.

    Args:
        node: Controller node.
        team: Robot team.
        stack: Subtasks of the team.
        team_time: Return the stamp of the newest state [ns], or None while it is unknown.

    Attributes:
        safety: Activity of singularities and joint limits.
        silent_sensors: Robots whose force sensor has timed out.
        wrenches: Newest wrenches on the tools, shape (N, 6) [N, N m]; zero without a sensor.
    """

    def __init__(
        self,
        node: ScenarioNode,
        team: Team,
        stack: SubtaskStack,
        team_time: Callable[[], int | None],
    ) -> None:
        general = node.scenario.general
        self._team, self._stack = team, stack
        self._rate = general.rate
        self._period = max(1, round(general.rate / general.telemetry_rate))
        self._lockstep = node.lockstep
        self._ticks = 0
        self._tick: Tick | None = None
        self.safety = LimitActivity(team.joint_names)
        self.wrenches = np.zeros((len(team.names), 6))
        self._stamps = node.stamp_checker(team_time)
        self._wrench_stamps = dict.fromkeys(general.force_sensors, -1)
        timeout = general.lockstep_timeout if node.lockstep else general.state_timeout
        self._sensor_timeout = max(timeout, SENSOR_PERIODS * self._period / self._rate)
        self.silent_sensors: set[str] = set()
        for name in general.force_sensors:
            callback = partial(self._on_wrench, name)
            qos = LOOP_QOS if node.lockstep else NEWEST_QOS
            node.subscribe(WrenchStamped, f"{name}/external_wrench", callback, qos=qos)
        self._codecs = [
            SubtaskCodec(task.name, task.elements, task.axes, task.rotates)
            for task in stack.subtasks
        ]
        self._energy_codec = EnergyCodec(LABELS)
        self._team_energy = TeamEnergyPublisher(node)
        # Sensors on some robots alone know nothing of the others; without any, an observer does.
        self._known = len(general.force_sensors) in (0, len(team.names))
        create, names = node.create_publisher, stack.names
        motion, energy = MultiDOFJointTrajectory, Float64MultiArray
        self._state_publishers = [create(motion, f"{name}/state", LOOP_QOS) for name in names]
        self._desired_publishers = [create(motion, f"{name}/desired", LOOP_QOS) for name in names]
        self._energy_publishers = [create(energy, f"{name}/energy", LOOP_QOS) for name in names]
        self._lockstep_humans = {
            i for i, name in enumerate(names) if f"{name}/human" in general.lockstep_sources
        }
        # A wrench message has one element, so subtasks with several edges have no feedback.
        self._feedback_publishers = {
            i: create(WrenchStamped, f"{task.name}/feedback", LOOP_QOS)
            for i, task in enumerate(stack.subtasks)
            if len(task.elements) == 1
        }

    def _on_wrench(self, robot: str, message: WrenchStamped) -> None:
        stamp, wrench = external_wrench(message)
        self._stamps.accept(robot, stamp)
        self.wrenches[self._team.index(robot)] = wrench
        self._wrench_stamps[robot] = stamp
        self.silent_sensors.discard(robot)

    def reset(self) -> None:
        """Discard the stamps of received wrenches, and reset limit activity and energy sums."""
        self._stamps.reset()
        self.safety.reset()
        self._team_energy.reset()
        self._wrench_stamps = dict.fromkeys(self._wrench_stamps, -1)
        self.silent_sensors.clear()

    def discard_ahead(self, stamp: int) -> None:
        """Discard wrenches received before the first state that are ahead of its stamp [ns]."""
        for robot, newest in self._wrench_stamps.items():
            if newest > stamp + 1e9 / self._rate:
                self.wrenches[self._team.index(robot)] = 0.0
                self._wrench_stamps[robot] = -1
                self._stamps.discard(robot)

    def missing(self, stamp: int, waiting_since: float) -> list[str]:
        """Return the wrench topics still awaited by the tick with this stamp [ns].

        A sensor that has timed out is not awaited until its next wrench.

        Args:
            stamp: Stamp of the tick [ns].
            waiting_since: Monotonic time at which the state of the tick was received [s].
        """
        tick = round(seconds(stamp) * self._rate)
        if tick % self._period:
            return []
        late = {name for name, newest in self._wrench_stamps.items() if newest < stamp}
        if late and time.monotonic() - waiting_since > self._sensor_timeout:
            self.silent_sensors |= late
            self.wrenches[[self._team.index(name) for name in late]] = 0.0
        return [f"{name}/external_wrench" for name in sorted(late - self.silent_sensors)]

    def check_sensors(self) -> None:
        """Wall time: zero the wrenches of sensors that have been silent for the timeout."""
        for name in self._wrench_stamps:
            if self._stamps.silence(name) > self._sensor_timeout:
                self.silent_sensors.add(name)
                self.wrenches[self._team.index(name)] = 0.0

    def publish(self, stamp: int, core: TeamController, tick: Tick) -> None:
        """Publish a tick with the stamp [ns] of the state it answers."""
        self._tick = tick
        self.safety.record(seconds(stamp), tick)
        slices = self._stack.slices
        count = round(seconds(stamp) * self._rate) if self._lockstep else self._ticks
        due = count % self._period == 0
        self._ticks += 1
        for i, publisher in self._feedback_publishers.items():
            if due or i in self._lockstep_humans or tick.led[i].source == "human":
                feedback = tick.feedback[slices[i]]
                publisher.publish(self._codecs[i].encode_wrench(stamp, feedback))
        if not due:
            return
        energy = core.energy(tick, self._team.external_torque(tick.state, self.wrenches))
        external_torque = core.external.torque(tick.state, self.wrenches)
        self._team_energy.publish(stamp, tick, external_torque)
        energies = rows(seconds(stamp), tick, energy, self.safety)
        for i, codec in enumerate(self._codecs):
            desired, values = tick.led[i].reference, self._stack.value_slices[i]
            actual = codec.encode(stamp, tick.task.x[values], tick.x_rate[slices[i]])
            self._state_publishers[i].publish(actual)
            self._desired_publishers[i].publish(
                codec.encode(stamp, desired.position, desired.velocity, desired.acceleration)
            )
            self._energy_publishers[i].publish(self._energy_codec.encode(energies[i]))

    def values(self) -> dict[str, object]:
        """Return singular value, tracking errors, limit activity and account for diagnostics."""
        if self._tick is None:
            return {}
        singular_values = np.linalg.svd(self._tick.task.J, compute_uv=False)
        values: dict[str, object] = {"smallest singular value": float(singular_values[-1])}
        for name, part in zip(self._stack.names, self._stack.slices, strict=True):
            values[f"{name} error"] = float(np.abs(self._tick.error.e[part]).max())
        measured, exchanged = self._team_energy.measured, self._team_energy.exchanged
        account = self._tick.account
        values |= self.safety.values() | account_values(account)
        values["received by motion [J]"] = account.received
        values["received by forces [J]"] = measured if self._known else "not known"
        if self._known and (text := model_error_text(account, measured, exchanged)):
            values["model error"] = text
        return values

    def problem(self) -> str:
        """Return the error text of the energy account, or ""."""
        return imbalance_text(self._tick.account) if self._tick else ""


class TeamEnergyPublisher:
    """Publisher of the energy account of the team on `energy`.

    Integrates the power measured at the port over the published ticks.

    Args:
        node: Controller node.

    Attributes:
        measured: Energy received since the account began, by measured or estimated forces [J].
        exchanged: Integral of the size of its power [J].
    """

    def __init__(self, node: ScenarioNode) -> None:
        self._codec = EnergyCodec(ACCOUNT_LABELS)
        self._publisher = node.create_publisher(Float64MultiArray, "energy", LOOP_QOS)
        self.reset()

    def reset(self) -> None:
        """Reset the integrals of the measured power."""
        self._last: tuple[float, float, int] | None = None
        self.measured = self.exchanged = 0.0

    def publish(self, stamp: int, tick: Tick, external_torque: Array) -> None:
        """Publish the account of a tick.

        Args:
            stamp: Stamp of the state [ns].
            tick: Tick that answers it.
            external_torque: Measured or estimated tau_e, shape (n,) [N or N m].
        """
        now, account = seconds(stamp), tick.account
        force = tick.dynamics.force_of(external_torque)
        supplied = float(tick.error.e_rate @ force)
        if self._last is None or self._last[2] != account.number:
            self.measured = self.exchanged = 0.0
        else:
            before, power, _ = self._last
            self.measured += 0.5 * (now - before) * (power + supplied)
            self.exchanged += 0.5 * (now - before) * (abs(power) + abs(supplied))
        self._last = (now, supplied, account.number)
        numbers = quantities(account, supplied, self.measured)
        self._publisher.publish(self._codec.encode(np.array((now, *numbers))))


def account_values(account: EnergyAccount) -> dict[str, object]:
    """Return the energy account as values for `/diagnostics`."""
    tank = account.tank
    return {
        "sigma": account.sigma,
        "nu": tank.nu,
        "damping": tank.damping,
        "tank [J]": tank.level,
        "owed [J]": tank.owed,
        "reserve [J]": tank.reserve,
        "residual [J]": account.residual,
    }


def imbalance_text(account: EnergyAccount) -> str:
    """Return the error text of an account that does not balance, or ""."""
    if account.sound:
        return ""
    found, bound = account.imbalance, account.bound
    return f"the energy account does not balance: {found:.3g} J, rounding error {bound:.1g} J"
