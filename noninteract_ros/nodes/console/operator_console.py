# SPDX-License-Identifier: Apache-2.0
"""Node `operator_console`: browser page to monitor, drive and stop a team."""

import json
import os
import queue
import secrets
import time
from collections.abc import Sequence
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from trajectory_msgs.msg import MultiDOFJointTrajectory

from noninteract_ros.clock import seconds
from noninteract_ros.console.console_scene import ConsoleScene
from noninteract_ros.console.drive import Drive, DriveState
from noninteract_ros.console.driver_lock import DriverLock
from noninteract_ros.console.frames import encode_poses
from noninteract_ros.console.handles import drivable_subtasks
from noninteract_ros.console.held_input import DeadMansSwitch, HeldInput
from noninteract_ros.console.protocol import PageCommand
from noninteract_ros.nodes.common.guarded_node import LOOP_QOS
from noninteract_ros.nodes.common.node import ScenarioNode
from noninteract_ros.nodes.common.program import run_program
from noninteract_ros.nodes.common.wall_rate import WallRate
from noninteract_ros.nodes.console.service_clients import ServiceClients
from noninteract_ros.nodes.console.status import StackStatus
from noninteract_ros.nodes.console.subscriptions import ConsoleSubscriptions
from noninteract_ros.nodes.messages.messages import Level, SubtaskCodec
from noninteract_ros.scenario.console_settings import ConsoleSettings

TOKEN_VARIABLE = "NONINTERACT_CONSOLE_TOKEN"
MAX_STEP = 0.05  # [s] of a reference after a gap in the team's states
SAMPLE_PERIOD = 0.05  # [s] of plots
STATUS_PERIOD = 0.2  # [s]
PARAMETER_PERIOD = 1.0  # [s] of reading parameters
STALE = 0.3  # [s] age of the team's state from which driving is disabled


class OperatorConsole(ScenarioNode):
    """Web server of the page, and publisher of the references that its driver asks for.

    The server runs in its own thread. Commands of pages pass through a queue, held inputs through
    the dead-man's switch. The main thread reads both, so that inputs are released even if the
    server hangs.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("operator_console", **kwargs)
        self.settings = self.scenario.console or ConsoleSettings()
        team = self.scenario.build_team()
        stack = self.scenario.build_stack(team)
        self._scene = ConsoleScene(self.scenario, team, stack)
        # Lockstep waits for references of its sources at each tick, which an operator cannot give.
        sources = self.scenario.general.lockstep_sources if self.lockstep else ()
        self._awaited = [name for name in stack.names if f"{name}/human" in sources]
        found = drivable_subtasks(self.scenario, stack)
        self._drivable = {name: found[name] for name in found if name not in self._awaited}
        # A node without an executor: its messages are taken only when they are needed.
        self._subscriber = Node(
            "operator_console_subscriber", namespace=self.get_namespace(), context=self.context
        )
        self._team_state = ConsoleSubscriptions(
            self._subscriber, team, stack, self._scene.body_names
        )
        self._service_clients = ServiceClients(self, stack.names)
        self._commands: queue.SimpleQueue[tuple[int, PageCommand]] = queue.SimpleQueue()
        self._switch = DeadMansSwitch(self.settings.hold_timeout)
        self._lock = DriverLock(self._switch)
        self._drive = Drive(self._drivable)
        self._status = StackStatus(stack)
        self._state_at = -1e9
        self._reference_stamp = -1  # Stamp of the state of the last references [ns].
        self._status_at = self._sample_at = 0.0
        self._sent = 0
        self._references = {
            task.name: (
                SubtaskCodec(task.name, task.elements, task.axes, task.rotates),
                self.create_publisher(
                    MultiDOFJointTrajectory, f"{task.name}/human/reference", LOOP_QOS
                ),
            )
            for task in stack.subtasks
            if task.name in self._drivable
        }
        self.subscribe(DiagnosticArray, "/diagnostics", self._status.update)
        self._token = os.environ.get(TOKEN_VARIABLE, "")
        if not self._token and not self.settings.is_local:
            self._token = secrets.token_urlsafe(18)
        # Imported here, so that a wrong parameter file is rejected without loading the server.
        from noninteract_ros.console.server import ConsoleServer

        self._server = ConsoleServer(self.settings, self._token, self._lock, self)
        self._server.start()

    @property
    def url(self) -> str:
        """Address of the page; browsers do not send the part after #."""
        host = self.settings.host if self.settings.is_local else "<this machine>"
        host = f"[{host}]" if ":" in host else host
        secret = f"#token={self._token}" if self._token else ""
        return f"http://{host}:{self._server.port}/{secret}"

    def greeting(self) -> list[str | bytes]:
        """Return the messages that open a connection; called in the server's thread."""
        extra = {
            "drivable": list(self._drivable),
            "awaited": self._awaited,
            "namespace": self.get_namespace(),
        }
        return self._scene.greeting(extra)

    def accepts(self, held: HeldInput) -> bool:
        """Return True if the subtask is drivable and has the element."""
        found = self._drivable.get(held.subtask)
        return found is not None and held.element < found.elements

    def enqueue(self, page: int, command: PageCommand) -> None:
        """Queue a command of a page; called in the server's thread."""
        self._commands.put((page, command))

    @property
    def has_loop(self) -> bool:
        """True, in lockstep too: pages are served in wall time."""
        return True

    def run(self) -> None:
        """Run until the context is shut down."""
        # Not through the logger, whose topic is public: the address may contain the token.
        print(f"operator_console: open {self.url}", flush=True)
        super().run()

    def loop(self) -> None:
        """Publish references at the update rate and send frames at the frame rate."""
        rate = WallRate(self.settings.update_rate)
        divisor = max(1, round(self.settings.update_rate / self.settings.frame_rate))
        count = 0
        try:
            while self.context.ok():
                rate.sleep()
                self._process_commands()
                self._publish_references()
                if count % divisor == 0 and self._server.pages:
                    self._send_frame()
                count += 1
        finally:
            self._server.stop()

    def _process_commands(self) -> None:
        """Send queued commands to their services and responses to their pages."""
        while not self._commands.empty():
            page, command = self._commands.get_nowait()
            if command.kind in ("stop", "reset"):
                self._switch.release()
                self._drive.reset()
            if command.kind == "reset" and not self._status.stopped:
                self._reset(page, command)
            else:
                self._service_clients.send(command, partial(self._respond, page, command))
        self._service_clients.poll()
        if self._server.pages:
            self._service_clients.read_parameters(PARAMETER_PERIOD)

    def _reset(self, page: int, command: PageCommand) -> None:
        """Reset between a stop and a resume, else the controller leads the team back."""

        def resume(done: bool, text: str) -> None:
            self._service_clients.send(
                PageCommand("resume", {}), lambda *_: self._respond(page, command, done, text)
            )

        def reset(done: bool, text: str) -> None:
            if done:
                self._service_clients.send(command, resume)
            else:
                self._respond(page, command, done, text)

        self._service_clients.send(PageCommand("stop", {}), reset)

    def _respond(self, page: int, command: PageCommand, done: bool, text: str) -> None:
        self._server.send(page, {"kind": "response", "ok": done, "text": text})
        if done:
            self._status.expect(command)
            self._status_at = 0.0

    def _publish_references(self) -> None:
        """Publish references that follow the held input, or bring its motion to rest."""
        held = self._switch.held(time.monotonic())
        if held is None and not self._drive.active:
            self._reference_stamp = -1
            return
        self._update_team_state()
        team = self._team_state
        # In the team's time, which may be slower than wall time.
        elapsed = (
            seconds(team.stamp - self._reference_stamp) if self._reference_stamp >= 0 else 0.0
        )
        step, self._reference_stamp = min(max(0.0, elapsed), MAX_STEP), team.stamp
        state = DriveState(
            desired=team.desired,
            frames=self._scene.frames(team.state),
            enabled=self._enabled_subtasks(),
        )
        stamp = team.stamp if self.lockstep else self.get_clock().now().nanoseconds
        for name, reference in self._drive.step(held, state, step).items():
            codec, publisher = self._references[name]
            publisher.publish(
                codec.encode(stamp, reference.position, reference.velocity, reference.acceleration)
            )
            self._sent += 1

    def _enabled_subtasks(self) -> frozenset[str]:
        """Return the subtasks with human authority, if the state is fresh and not stopped."""
        age = time.monotonic() - self._state_at
        if age > STALE or self._status.stopped:
            return frozenset()
        parameters = self._service_clients.parameters
        return frozenset(
            name for name in self._drivable if parameters.get(f"{name}.authority") == "human"
        )

    def _update_team_state(self) -> None:
        if self._team_state.update_state():
            self._state_at = time.monotonic()
        self._team_state.update_motions()

    def _send_frame(self) -> None:
        """Send the poses of one frame, and plots and status at their own periods."""
        now = time.monotonic()
        self._update_team_state()
        team = self._team_state
        stamp = seconds(max(0, team.stamp))
        poses = self._scene.poses(team.q, team.state, team.desired, team.bodies)
        self._server.broadcast(encode_poses(stamp, poses))
        if now - self._sample_at >= SAMPLE_PERIOD:
            self._sample_at = now
            team.update_energies()
            sample = self._scene.sample(stamp, team.state, team.desired)
            self._server.broadcast(json.dumps(sample | {"energy": team.energy}))
        if now - self._status_at >= STATUS_PERIOD:
            self._status_at = now
            message = self._status.message(self._service_clients.parameters, self._state_at)
            message |= {
                "driver": self._lock.driver,
                "pages": self._server.pages,
                "held": getattr(self._switch.held(now), "subtask", None),
                "refill": self._service_clients.is_available("refill"),
            }
            self._server.broadcast(json.dumps(message))

    def status(self) -> tuple[Level, str, dict[str, object]]:
        """Return driver, pages and rejected connections for `/diagnostics`."""
        held = self._switch.held(time.monotonic())
        values: dict[str, object] = {
            "pages": self._server.pages,
            "driver": self._lock.driver or "none",
            "held": held.subtask if held else "nothing",
            "references sent": self._sent,
            "refused connections": self._server.rejected,
        }
        if self._lock.driver is None:
            return Level.OK, "no driver", values
        return Level.OK, f"driving {held.subtask}" if held else "no input held", values

    def destroy_node(self) -> None:
        """Stop the server, then destroy the node."""
        self._server.stop()
        self._subscriber.destroy_node()
        super().destroy_node()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node; return the exit status."""
    return run_program(OperatorConsole, arguments)
