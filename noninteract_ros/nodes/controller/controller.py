# SPDX-License-Identifier: Apache-2.0
"""Program `controller`: central decoupling controller of the team."""

import time
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from std_msgs.msg import Bool, Header
from std_srvs.srv import Trigger

from noninteract_ros.arrays import Array
from noninteract_ros.clock import seconds
from noninteract_ros.control.controller import TeamController
from noninteract_ros.control.references.inputs import HORIZON, SOURCES
from noninteract_ros.errors import InputError, StepError
from noninteract_ros.nodes.common.descriptions import LATCHED_QOS
from noninteract_ros.nodes.common.lockstep import LockstepSources
from noninteract_ros.nodes.common.node import ScenarioNode
from noninteract_ros.nodes.common.program import run_program
from noninteract_ros.nodes.common.team_status import TeamStatus
from noninteract_ros.nodes.common.wall_rate import WallRate
from noninteract_ros.nodes.controller.diagnostics import ControllerDiagnostics
from noninteract_ros.nodes.controller.parameters import AuthorityTopics, LiveParameters
from noninteract_ros.nodes.controller.source_subscriptions import Input, subscribe_to_source
from noninteract_ros.nodes.controller.supervision import LoopSupervision
from noninteract_ros.nodes.controller.team_interface import TeamInterface
from noninteract_ros.nodes.controller.telemetry import Telemetry
from noninteract_ros.nodes.messages.messages import Level, SubtaskCodec, stamp_ns

CHECK_PERIOD = 0.1  # [s] between checks for absent lockstep sources and planned hand-overs
BRAKE_TIME = 2.0  # [s] maximum time to brake effort-controlled robots on shutdown
REST_SPEED = 1e-3  # [m/s or rad/s]
MIN_REPORTED_WAIT = 0.3  # [s] minimum wait before it is reported


class Controller(ScenarioNode):
    """Node that answers each state of the team with the torques of the control law.

    Callbacks only queue their work. The loop, or in lockstep the callback itself, does the queued
    work before the next tick, so that one thread alone uses the core.
    """

    LIVE = True

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("controller", **kwargs)
        general = self.scenario.general
        self.get_logger().info("compiling the control law; this takes longer on the first start")
        team, stack = self.scenario.team, self.scenario.stack
        self.core: TeamController = self.scenario.build_controller(team, stack)
        self.core.prepare()
        self._queue: deque[Callable[[], None]] = deque()
        self._state: tuple[int, Array, Array, Array | None] | None = None
        self._state_received_at = self._waiting_since = -np.inf
        self._stamps = self.stamp_checker(self._team_time)
        self._missing: list[str] = []
        self._answered: int | None = None
        self._reset_stamp: int | None = None
        self._stop_requested = False
        self._now = 0.0
        self._telemetry = Telemetry(self, team, stack, self._team_time)
        self._controller_diagnostics = ControllerDiagnostics(self, self.core, self._telemetry)
        self._live = LiveParameters(
            self, self.core, self._post, self._controller_diagnostics.changed, self._configuration
        )
        self._authority = AuthorityTopics(self, stack.names)
        self._team_status = TeamStatus(self)
        self._sources = LockstepSources(
            general.lockstep_sources if self.lockstep else (),
            self.core.inputs,
            general.lockstep_timeout,
        )
        self._supervision = LoopSupervision(self.scenario, self.core, self.timing)
        self._interface = TeamInterface(self, team, self._on_state)
        self.subscribe(Header, "put_back", self._on_team_reset)
        for subtask in stack.subtasks:
            codec = SubtaskCodec(subtask.name, subtask.elements, subtask.axes, subtask.rotates)
            for source in SOURCES:
                subscribe_to_source(self, codec, source, self._on_input)
        # Latched, so that a team that is restarted stays stopped. Nothing is published before the
        # first stop, so that a restarted controller does not resume the team.
        self._stopped_publisher = self.create_publisher(Bool, "stopped", LATCHED_QOS)
        self.create_service(Trigger, "~/stop", self._on_stop)
        self.create_service(Trigger, "~/resume", self._on_resume)
        self.create_service(Trigger, "~/refill", self._on_refill)
        if self.lockstep:
            self.create_wall_timer(CHECK_PERIOD, self._answer_if_complete)
        self.create_wall_timer(CHECK_PERIOD, self._live.sync_authority)

    def _on_input(self, topic: str, subtask: str, source: str, received: Input) -> None:
        self._post(partial(self._receive, topic, subtask, source, received))

    def _post(self, work: Callable[[], None]) -> None:
        """Queue work for the thread of the core, to be done before the next tick."""
        self._queue.append(work)
        if self.lockstep:
            self._run_queue()
            self._answer_if_complete()

    def _run_queue(self) -> None:
        while self._queue:
            self._queue.popleft()()

    def _receive(self, topic: str, subtask: str, source: str, received: Input) -> None:
        """Pass an input, or the marker that there is none, to the core."""
        if not self._has_fresh_state():
            return  # The time of the team is unknown; lockstep sources resend their inputs.
        stamp, item = received
        inputs = self.core.inputs[subtask].sources[source]
        when = seconds(stamp)
        try:
            self._check_input_age(subtask, stamp)
        except InputError as error:
            self.reject_input(topic, str(error))
            return
        if self._sources.starts_late(f"{subtask}/{source}", when, self._now):
            return
        if item is None:
            inputs.mark_complete_until(when)
            return
        if self.lockstep and self._now <= when < seconds(self._stamps.last(topic)):
            return  # Resent by a source that received the state twice.
        # Inputs without a stamp, or stamped by another clock, take effect immediately.
        at_once = stamp == 0 or not self.lockstep
        try:
            if stamp:
                self._stamps.check(topic, stamp, max_lead=np.inf, max_age=np.inf)
            inputs.receive(self._now if at_once else when, item, self._now)
        except InputError as error:
            self.reject_input(topic, str(error))
            return
        if stamp:
            self._stamps.record(topic, stamp)

    def _check_input_age(self, subtask: str, stamp: int) -> None:
        """Check the time of an input of a source, or of its marker.

        Inputs without a stamp take effect immediately, those older than their timeout never.
        """
        if not stamp:
            return
        if self.lockstep:
            self._stamps.check_age(stamp, max_lead=HORIZON)
        else:
            timeout = self.scenario.subtasks[subtask].input.timeout
            self._stamps.check_age(stamp, max_age=timeout)

    def _team_time(self) -> int | None:
        """Return the stamp of the newest state [ns], or None before the first one."""
        return None if self._state is None else self._state[0]

    def _has_fresh_state(self) -> bool:
        age = time.monotonic() - self._state_received_at
        fresh = self.lockstep or age <= self.scenario.general.state_timeout
        return self._state is not None and fresh

    def _on_state(self, stamp: int, positions: Array, v: Array) -> None:
        """Receive joint positions and velocities (n,) of the team at a stamp [ns]."""
        q = self.core.team.configuration_from_joints(positions)
        if self._stamps.accept_state("joint_states", stamp):
            self._restart(stamp)
        if self._state is None:
            self._telemetry.discard_ahead(stamp)
        self._state_received_at = time.monotonic()
        if stamp == self._answered:
            if self.lockstep:  # The team has not received the answer.
                self._interface.resend()
            return
        if self._state is None or stamp != self._state[0]:
            self._waiting_since = self._state_received_at
        # In lockstep the applied torque can only be the last answer.
        self._state = (stamp, q, v, None if self.lockstep else self._interface.applied)
        if self.lockstep:
            self._answer_if_complete()

    def _on_team_reset(self, message: Header) -> None:
        """Receive the stamp of the first state after a reset of the team; its time goes on."""
        self._reset_stamp = stamp_ns(message.stamp)

    def _configuration(self) -> Array | None:
        state = self._state
        return None if state is None else state[1]

    def _restart(self, stamp: int) -> None:
        """Discard inputs received before the restart of the team."""
        self._state = self._answered = self._reset_stamp = None
        self._stamps.reset()
        self._stamps.record("joint_states", stamp)
        self._telemetry.reset()
        self._supervision.reset()
        self._post(self.core.reset)

    def _answer_if_complete(self) -> None:
        """Lockstep: answer the state once all inputs of its tick are received."""
        if self._state is None or self._answered == self._state[0]:
            return
        self._now = seconds(self._state[0])
        self._missing = self._sources.missing(self._now, self._waiting_since)
        if not self._missing:
            self._missing = self._telemetry.missing(self._state[0], self._waiting_since)
        if not self._missing:
            self._hold_team(self.descriptions.problem or self._sensor_problem())
            self._answer(*self._state)

    def _answer(self, stamp: int, q: Array, v: Array, applied: Array | None) -> None:
        began = time.perf_counter()
        if self._reset_stamp is not None and stamp >= self._reset_stamp:
            self._reset_stamp = None
            self._supervision.reset()
            self.core.reset_state()
        now, wrenches = seconds(stamp), self._telemetry.wrenches
        try:
            tick = self.core.step(now, q, v, applied, wrenches)
        except Exception as error:  # Not an input's fault: the team brakes without a controller.
            raise StepError(f"the control step at {now:.6f} s failed: {error!r}") from error
        self._answered = stamp
        if not self._is_expired(stamp):
            self._interface.answer(stamp, tick)
            self.timing.record(stamp, seconds(self.now_ns() - stamp))
        if not self.lockstep:
            self._stop_if_implausible(stamp, q, tick.restarted)
        self._telemetry.publish(stamp, self.core, tick)
        self._controller_diagnostics.update(seconds(stamp), tick)
        self._controller_diagnostics.cycle_times.append(time.perf_counter() - began)

    def _stop_if_implausible(self, stamp: int, q: Array, restarted: str) -> None:
        """Stop the team, latched, if its states jump repeatedly."""
        reason = self._supervision.jumps_repeatedly(seconds(stamp), q, restarted)
        if reason and not self._stop_requested:
            self.get_logger().error(f"stopped: {reason}")
            self._controller_diagnostics.stop_reason = reason
            self._stop_requested = True
            self._stopped_publisher.publish(Bool(data=True))
            self.core.stop()

    def _is_expired(self, stamp: int) -> bool:
        """Return True for a state too old to be answered, as after a pause of this program."""
        if self.lockstep:
            return False
        try:
            self._stamps.check_age(stamp)
        except InputError as error:
            self.reject_input("joint_states", f"unanswered: {error}")
            return True
        return False

    def loop(self) -> None:
        """Wall time: answer the newest state, once it is received or once per period."""
        rate = WallRate(self.scenario.general.rate)
        states = self._interface.states
        while self.running and not self.shutdown_requested():
            if states is not None:
                states.wait(1.0 / self.scenario.general.rate)
            else:
                rate.sleep()
            self.run_once()
        if self.context.ok() and self._interface.efforts:
            self._shut_down(rate)

    def _shut_down(self, rate: WallRate) -> None:
        """Brake the team, since effort controllers would hold the last torques indefinitely."""
        self._post(self.core.stop)
        end = time.monotonic() + BRAKE_TIME
        while self._state is not None and np.abs(self._state[2]).max() > REST_SPEED:
            if time.monotonic() > end:
                break
            rate.sleep()
            self.run_once()
        self._interface.efforts.shut_down()

    @property
    def handles_shutdown(self) -> bool:
        """True where effort-controlled robots are braked before the program ends."""
        return self.has_loop and bool(self._interface.efforts)

    def run_once(self) -> None:
        """Wall time: process received inputs and answer the newest state if it is unanswered."""
        self._interface.poll()
        problem = self.descriptions.problem or self._interface.problem()
        if self._state is not None:
            self._telemetry.check_sensors()
        problem = problem or self._supervision.overload or self._sensor_problem()
        self._hold_team(problem)
        state = self._state
        if state is not None:
            self._now = seconds(state[0])
        self._run_queue()
        if state is None or self._answered == state[0]:
            return
        if self._is_expired(state[0]):
            self._answered = state[0]
        else:
            self._answer(*state)

    def on_description_changed(self) -> None:
        """Hold the team until a restart, since the model no longer matches the robots."""
        if self.lockstep:
            self._hold_team(self.descriptions.problem)

    def _sensor_problem(self) -> str:
        """Return why the force regulated with silent sensors must be released, or ""."""
        silent = sorted(self._telemetry.silent_sensors)
        if not silent or not self.core.mode.impedance.goal_gain.any():
            return ""
        return f"no external_wrench of {', '.join(silent)}, by which a force is regulated"

    def _hold_team(self, problem: str) -> None:
        """Hold the team, as a stop does, while there is a problem that may disappear by itself."""
        if problem == self._controller_diagnostics.problem:
            return
        self._controller_diagnostics.problem = problem
        if problem:
            self.get_logger().error(f"holding the team: {problem}")
            if not self.core.mode.stopped:
                self.core.stop()
            return
        self.get_logger().info("problem resolved: no longer holding the team")
        if not self._stop_requested:
            self.core.resume()

    def _on_stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._stop_requested = True
        self._stopped_publisher.publish(Bool(data=True))
        self._post(self.core.stop)
        return self._succeed(response, "stopped")

    def _on_refill(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._post(self.core.gate.refill)
        return self._succeed(response, "energy tank filled")

    def _on_resume(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._stop_requested = False
        self._controller_diagnostics.stop_reason = ""
        self._stopped_publisher.publish(Bool(data=False))
        if problem := self._controller_diagnostics.problem:
            response.success, response.message = False, f"holding the team: {problem}"
            return response
        self._post(self.core.resume)
        return self._succeed(response, "running")

    def _succeed(self, response: Trigger.Response, text: str) -> Trigger.Response:
        self.get_logger().info(text)
        response.success, response.message = True, text
        return response

    def status(self) -> tuple[Level, str, dict[str, object]]:
        """Return the state machine, cycle times, subtask conditioning and silent sources."""
        now = time.monotonic()
        if self._state is not None and not self.lockstep:
            self._supervision.check_rate(self._state[1])
        if self._state is None:
            age, waiting = None, self._interface.waiting_for()
        else:
            age = now - self._state_received_at
            waiting = self._missing if now - self._waiting_since > MIN_REPORTED_WAIT else []
        return self._controller_diagnostics.status(
            now=self._now,
            age=age,
            team_status=self._team_status.reason,
            waiting=waiting,
            absent=self._sources.absent
            | {f"{name}/external_wrench" for name in self._telemetry.silent_sensors},
        )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program."""
    return run_program(Controller, arguments)
