# SPDX-License-Identifier: Apache-2.0
"""Program `robot_team`: simulated robot team with torque inputs."""

import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import WrenchStamped
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool, Header, String
from std_srvs.srv import SetBool, Trigger

from noninteract_ros.clock import seconds, tick_stamp
from noninteract_ros.errors import InputError, StepError
from noninteract_ros.nodes.common.descriptions import LATCHED_QOS
from noninteract_ros.nodes.common.guarded_node import LOOP_QOS
from noninteract_ros.nodes.common.node import ScenarioNode
from noninteract_ros.nodes.common.program import run_program
from noninteract_ros.nodes.common.team_status import FINISHED, PAUSED
from noninteract_ros.nodes.common.wall_rate import WallRate
from noninteract_ros.nodes.messages import messages
from noninteract_ros.nodes.messages.messages import Level
from noninteract_ros.nodes.team.simulated_drivers import BodyPosePublisher, SimulatedDrivers

STOP_DURATION = 10.0  # in units of 1 / stop_rate, within which a controller brings it to rest
RESEND_PERIOD = 0.2  # [s] wall time after which an unanswered state is published again


class RobotTeam(ScenarioNode):
    """Node that integrates equation (2) under the torques that answer its states.

    In lockstep a state is stamped with simulated time, and the team steps when it receives the
    command with that stamp; with `real_time` also not before its period has begun. In wall time
    it steps at its rate, holds the last command for `command_timeout` and then brakes.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("robot_team", **kwargs)
        general = self.scenario.general
        team = self.scenario.team
        self._team = team
        self._simulation = self.scenario.build_simulation(team, self.scenario.stack)
        self._telemetry_period = max(1, round(general.rate / general.telemetry_rate))
        self._lock = threading.Lock()
        self._paced = self.lockstep and general.real_time
        self._step_allowed = threading.Event()
        self._paused = general.start_paused
        self._stamp = self._previous_stamp = 0
        self._stamps = self.stamp_checker(lambda: self._stamp)
        self._problem = ""
        self._stopped_at: float | None = None  # Monotonic time from which a stop is held.
        self._sent_at = 0.0
        self._command: tuple[int, np.ndarray] | None = None
        self._command_received_at = -np.inf
        self._braking = False
        self._end_tick = round(general.end_time * general.rate) if general.end_time else None
        self._drivers = SimulatedDrivers(self, team, self._on_command)
        self._publish_descriptions()
        self._body_poses = BodyPosePublisher(self, self._simulation)
        self._wrench_publishers = [
            self.create_publisher(WrenchStamped, f"{name}/external_wrench", LOOP_QOS)
            for name in team.names
        ]
        self._reset_publisher = self.create_publisher(Header, "put_back", LOOP_QOS)
        self._clock_publisher = (
            self.create_publisher(Clock, "/clock", LOOP_QOS) if general.publish_clock else None
        )
        for robot in team.robots:
            tool = f"{robot.name}/{robot.tool_frame}"
            self.subscribe(
                WrenchStamped, f"{robot.name}/push", partial(self._on_push, robot.name, tool)
            )
        if not self.lockstep:
            self.subscribe(Bool, "stopped", self._on_stopped, qos=LATCHED_QOS)
        self.create_service(Trigger, "~/stop", self._locked(self._stop))
        self.create_service(Trigger, "~/resume", self._locked(self._resume))
        self.create_service(SetBool, "~/pause", self._on_pause)
        self.create_service(Trigger, "~/step", self._locked(self._step_once))
        self.create_service(Trigger, "~/reset", self._locked(self._reset))
        if self.lockstep:
            self.create_wall_timer(RESEND_PERIOD, self._resend)

    def _publish_descriptions(self) -> None:
        """Publish the robot descriptions as latched messages, for visualization."""
        for name, block in self.scenario.robots.items():
            if self.descriptions.is_subscribed_to(f"{name}/robot_description"):
                continue  # Another node publishes it.
            publisher = self.create_publisher(String, f"{name}/robot_description", LATCHED_QOS)
            publisher.publish(String(data=block.description(name)))

    def _on_command(self, answered: int | None, effort: np.ndarray) -> None:
        """Receive torques (n,) and the stamp [ns] of the answered state.

        Torques without a stamp answer the last state.
        """
        with self._lock:
            stamp = self._stamp if answered is None else answered
            if self.lockstep and stamp == self._previous_stamp != self._stamp:
                return  # A second answer to a state that was published twice.
            self._check_command(stamp)
            self._command, self._command_received_at = (stamp, effort), time.monotonic()
            if not self.lockstep:
                self.timing.record(stamp, seconds(self.now_ns() - stamp))
            if self.lockstep and not self._paused:
                self._step_when_due(effort)

    def _check_command(self, stamp: int) -> None:
        """Raise an InputError for a command that answers no state, in lockstep not the last."""
        if stamp > self._stamp or (self.lockstep and stamp != self._stamp):
            text = f"the last state has the stamp {seconds(self._stamp):.6f} s"
            raise InputError(f"stamp {seconds(stamp):.6f} s answers no state: {text}")
        # A pause or a slow controller may not bring torques of the past into force.
        self._stamps.accept("joint_commands", stamp)

    def _on_push(self, robot: str, tool_frame: str, message: WrenchStamped) -> None:
        stamp, axes, wrench = messages.push(message, tool_frame)
        if stamp:
            self._stamps.accept(robot, stamp)
        timeout = self.scenario.general.push_timeout
        with self._lock:
            self._simulation.push(robot, wrench, axes == "tool", timeout)

    def _step_when_due(self, torque: np.ndarray) -> None:
        """Lockstep: step under the received command, or let the loop do so when it is due."""
        if self._paced:
            self._step_allowed.set()
        else:
            self._advance(torque)

    def _on_stopped(self, message: Bool) -> None:
        """Receive a stop of the controller, which brings the team to rest smoothly, or its end."""
        duration = STOP_DURATION / self.scenario.general.stop_rate
        with self._lock:
            self._stopped_at = time.monotonic() + duration if message.data else None

    def _stop(self) -> tuple[bool, str]:
        self._stopped_at = -np.inf
        return True, "stopped: no torques are applied until resume"

    def _resume(self) -> tuple[bool, str]:
        self._stopped_at = None
        return True, "running"

    @property
    def _stop_held(self) -> bool:
        """True while the team brakes by itself and applies no torques."""
        return self._stopped_at is not None and time.monotonic() >= self._stopped_at

    def _advance(self, torque: np.ndarray | None) -> None:
        """Simulate one tick and publish the next state."""
        if self._finished():
            return
        simulation = self._simulation
        if self._stop_held:
            torque = None
        if torque is not None:
            torque = self._drivers.applied(torque, simulation.q, simulation.v)
        try:
            simulation.step(torque)
        except Exception as error:
            raise StepError(f"the step at {simulation.now:.6f} s failed: {error!r}") from error
        self._command = self._command if not self.lockstep else None
        self._publish()

    def _finished(self) -> bool:
        return self._end_tick is not None and self._simulation.tick >= self._end_tick

    def _next_stamp(self) -> int:
        """Return the stamp of a state that is published now [ns]."""
        if self.lockstep:
            return tick_stamp(self._simulation.tick, self._simulation.rate)
        return self.now_ns()

    def _publish(self) -> None:
        simulation, stamp = self._simulation, self._next_stamp()
        if stamp != self._stamp:
            self._previous_stamp, self._stamp = self._stamp, stamp
        self._sent_at = time.monotonic()
        if self._clock_publisher is not None:
            now = messages.to_stamp(tick_stamp(simulation.tick, simulation.rate))
            self._clock_publisher.publish(Clock(clock=now))
        # Wrenches are published first, so that they arrive before the state they belong to.
        if simulation.tick % self._telemetry_period == 0:
            for publisher, wrench in zip(
                self._wrench_publishers, simulation.external_wrenches(), strict=True
            ):
                publisher.publish(messages.to_wrench_stamped(self._stamp, wrench))
            self._body_poses.publish(self._stamp)
        positions = self._team.joints_from_configuration(simulation.q)
        arrays = (positions, simulation.v, simulation.torque)
        self._drivers.publish(self._stamp, simulation.tick, arrays)

    def _resend(self) -> None:
        """Publish an unanswered state again: the first one, or one whose answer was lost."""
        with self._lock:
            waiting = time.monotonic() - self._sent_at > RESEND_PERIOD
            idle = self._paused or self._finished()
            if waiting and not idle and self._command is None:
                self._publish()

    @property
    def has_loop(self) -> bool:
        """True in wall time, and in lockstep with `real_time`."""
        return not self.lockstep or self._paced

    def loop(self) -> None:
        """Step at the rate of the scenario in wall time."""
        rate = WallRate(self._simulation.rate)
        if self._paced:
            self._loop_paced(rate)
            return
        timeout = self.scenario.general.command_timeout
        while self.running:
            rate.sleep()
            self._drivers.poll()
            problem = self._drivers.problem()
            with self._lock:
                fresh = time.monotonic() - self._command_received_at <= timeout
                command = self._command if fresh and not problem else None
                self._problem = problem
                self._braking = command is None
                if not self._paused:
                    self._advance(command[1] if command else None)

    def _loop_paced(self, rate: WallRate) -> None:
        """Step once the command is received and the period has begun."""
        while self.running:
            rate.sleep()
            self._step_allowed.wait(RESEND_PERIOD)
            with self._lock:
                self._step_allowed.clear()
                if self._command is not None and not self._paused:
                    self._advance(self._command[1])

    def _locked(self, action: Callable[[], tuple[bool, str]]) -> Callable[[Any, Any], Any]:
        def serve(_: Any, response: Any) -> Any:
            with self._lock:
                response.success, response.message = action()
            return response

        return serve

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> Any:
        with self._lock:
            self._paused = request.data
            if self.lockstep and not self._paused:
                if self._command is not None:
                    self._step_when_due(self._command[1])
                else:
                    self._publish()
            response.success = True
            response.message = "paused" if self._paused else "running"
        return response

    def _step_once(self) -> tuple[bool, str]:
        if not self._paused:
            return False, "pause the team first"
        if self._command is None and self.lockstep:
            self._publish()
            return False, "no command has answered the state; it was published again"
        self._advance(self._command[1] if self._command else None)
        return True, f"stepped to {self._simulation.now:.6f} s"

    def _reset(self) -> tuple[bool, str]:
        self._simulation.reset()
        # The time goes on, so that no stamp goes back.
        self._simulation.tick += 1
        self._command = None
        self._reset_publisher.publish(Header(stamp=messages.to_stamp(self._next_stamp())))
        self._publish()
        return True, "reset to the initial state"

    def status(self) -> tuple[Level, str, dict[str, object]]:
        """Return the state machine, the time and the age of the last command."""
        age = time.monotonic() - self._command_received_at
        values: dict[str, object] = {
            "time [s]": self._simulation.now,
            "ticks": self._simulation.tick,
            "robots": len(self._team.names),
            "command age [s]": age,
        }
        if self._finished():
            return Level.OK, FINISHED, values
        if self._paused:
            return Level.OK, PAUSED, values
        if self._stop_held:
            text = f"; {self._problem}" if self._problem else ""
            level = Level.ERROR if self._problem else Level.WARN
            return level, f"stopped until resume{text}", values
        if self._command_received_at == -np.inf:
            return Level.WARN, "waiting for the first command", values
        if self.lockstep and age > 2 * RESEND_PERIOD:
            return Level.WARN, "waiting for the command that answers the state", values
        if self._problem:
            return Level.ERROR, f"braking: {self._problem}", values
        if self._braking:
            return Level.ERROR, "braking: command timeout", values
        if timed_out := self._drivers.timed_out():
            return Level.ERROR, f"braking {', '.join(timed_out)}: command timeout", values
        return Level.OK, "running", values


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program."""
    return run_program(RobotTeam, arguments)
