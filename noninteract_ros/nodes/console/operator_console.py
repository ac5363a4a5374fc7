# SPDX-License-Identifier: Apache-2.0
"""Program `operator_console`: a page in the browser to see a team, to lead it and to stop it."""

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
from noninteract_ros.console.drive import Drive, DriveState
from noninteract_ros.console.driver_lock import DriverLock
from noninteract_ros.console.frames import picture
from noninteract_ros.console.handles import drivables
from noninteract_ros.console.page_input import Held, PageDeadMan
from noninteract_ros.console.protocol import PageCommand
from noninteract_ros.console.stage import Stage
from noninteract_ros.nodes.common.node import LOOP_QOS, ScenarioNode, Ticker
from noninteract_ros.nodes.common.program import run_program
from noninteract_ros.nodes.console.calls import Calls
from noninteract_ros.nodes.console.status import StackStatus
from noninteract_ros.nodes.console.subscriptions import ConsoleSubscriptions
from noninteract_ros.nodes.messages.messages import Level, SubtaskCodec
from noninteract_ros.scenario.console_settings import ConsoleSettings

TOKEN_VARIABLE = "NONINTERACT_CONSOLE_TOKEN"
LONGEST_STEP = 0.05  # [s] of a reference, after a gap in the team's states
SAMPLE_PERIOD = 0.05  # [s] of plots
STATUS_PERIOD = 0.2  # [s]
READ_PERIOD = 1.0  # [s] of parameters
STALE = 0.3  # [s] age of the team's state from which nobody can drive


class OperatorConsole(ScenarioNode):
    """Serves the page; hears the team; speaks for the human while somebody holds something.

    The server has a thread of its own. What pages ask for comes out of a queue, what they hold
    out of the dead-man's switch; the main thread reads both, so that a server that hangs lets go.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("operator_console", **kwargs)
        self.settings = self.scenario.console or ConsoleSettings()
        team = self.scenario.build_team()
        stack = self.scenario.build_stack(team)
        self._stage = Stage(self.scenario, team, stack)
        # Lockstep waits for its sources; a person is none of those that can be waited for.
        awaited = self.scenario.general.lockstep_sources if self.lockstep else ()
        self._awaited = [name for name in stack.names if f"{name}/human" in awaited]
        found = drivables(self.scenario, stack)
        self._drivables = {name: found[name] for name in found if name not in self._awaited}
        # A node without an executor: what it hears is taken by hand, when it is wanted.
        self._listener = Node(
            "operator_console_ear", namespace=self.get_namespace(), context=self.context
        )
        self._ear = ConsoleSubscriptions(self._listener, team, stack, self._stage.body_names)
        self._calls = Calls(self, stack.names)
        self._asked: queue.SimpleQueue[tuple[int, PageCommand]] = queue.SimpleQueue()
        self._switch = PageDeadMan(self.settings.hold_timeout)
        self._seat = DriverLock(self._switch)
        self._drive = Drive(self._drivables)
        self._status = StackStatus(stack)
        self._state_at = -1e9
        self._led_at = -1  # Stamp of the state up to which references have been made [ns].
        self._told_at = self._sampled_at = 0.0
        self._sent = 0
        self._references = {
            task.name: (
                SubtaskCodec(task.name, task.elements, task.axes, task.rotates),
                self.create_publisher(
                    MultiDOFJointTrajectory, f"{task.name}/human/reference", LOOP_QOS
                ),
            )
            for task in stack.subtasks
            if task.name in self._drivables
        }
        self.subscribe(DiagnosticArray, "/diagnostics", self._status.note)
        self._token = os.environ.get(TOKEN_VARIABLE, "")
        if not self._token and not self.settings.is_local:
            self._token = secrets.token_urlsafe(18)
        # Here, so that a wrong parameter file is refused before all else is loaded.
        from noninteract_ros.console.server import ConsoleServer

        self._server = ConsoleServer(self.settings, self._token, self._seat, self)
        self._server.start()

    @property
    def url(self) -> str:
        """Where the page is; the part after # is not sent to anybody."""
        host = self.settings.host if self.settings.is_local else "<this machine>"
        host = f"[{host}]" if ":" in host else host
        secret = f"#token={self._token}" if self._token else ""
        return f"http://{host}:{self._server.port}/{secret}"

    def greeting(self) -> list[str | bytes]:
        """What a page is told first; called in the server's thread."""
        told = {
            "drivable": list(self._drivables),
            "awaited": self._awaited,
            "namespace": self.get_namespace(),
        }
        return self._stage.greeting(told)

    def knows(self, item: Held) -> bool:
        """Whether there is such a subtask, with such an element."""
        found = self._drivables.get(item.subtask)
        return found is not None and item.element < found.elements

    def command(self, page: int, said: PageCommand) -> None:
        """Keeps what a page asks for; called in the server's thread."""
        self._asked.put((page, said))

    @property
    def has_loop(self) -> bool:
        """In lockstep too: people have a time of their own."""
        return True

    def run(self) -> None:
        """Runs until the context is shut down."""
        # Not by the logger, whose topic anybody can hear: the address may hold the token.
        print(f"operator_console: open {self.url}", flush=True)
        super().run()

    def loop(self) -> None:
        """One round per reference; pictures at their own rate."""
        ticker = Ticker(self.settings.update_rate)
        every = max(1, round(self.settings.update_rate / self.settings.frame_rate))
        count = 0
        try:
            while self.context.ok():
                ticker.wait()
                self._obey()
                self._lead()
                if count % every == 0 and self._server.pages:
                    self._show()
                count += 1
        finally:
            self._server.stop()

    def _obey(self) -> None:
        """Passes on what pages have asked for, and what came of it."""
        while not self._asked.empty():
            page, said = self._asked.get_nowait()
            if said.kind in ("stop", "reset"):
                self._switch.release()
                self._drive.drop()
            if said.kind == "reset" and not self._status.stopped:
                self._reset(page, said)
            else:
                self._calls.ask(said, partial(self._answer, page, said))
        self._calls.poll()
        if self._server.pages:
            self._calls.read(READ_PERIOD)

    def _reset(self, page: int, said: PageCommand) -> None:
        """Resets between a stop and a resume: else the controller leads the team back again."""

        def resume(done: bool, text: str) -> None:
            self._calls.ask(
                PageCommand("resume", {}), lambda *_: self._answer(page, said, done, text)
            )

        def reset(done: bool, text: str) -> None:
            if done:
                self._calls.ask(said, resume)
            else:
                self._answer(page, said, done, text)

        self._calls.ask(PageCommand("stop", {}), reset)

    def _answer(self, page: int, said: PageCommand, done: bool, text: str) -> None:
        self._server.tell(page, {"kind": "answer", "ok": done, "text": text})
        if done:
            self._status.expect(said)
            self._told_at = 0.0

    def _lead(self) -> None:
        """Says what the held handle, pad or key asks for, or brings the motion to rest."""
        held = self._switch.held(time.monotonic())
        if held is None and not self._drive.active:
            self._led_at = -1
            return
        self._listen()
        # In the team's own time: it may be slower than that of the page.
        passed = seconds(self._ear.stamp - self._led_at) if self._led_at >= 0 else 0.0
        step, self._led_at = min(max(0.0, passed), LONGEST_STEP), self._ear.stamp
        scene = DriveState(self._ear.desired, self._stage.frames(self._ear.state), self._led())
        stamp = self._ear.stamp if self.lockstep else self.get_clock().now().nanoseconds
        for name, reference in self._drive.step(held, scene, step).items():
            codec, publisher = self._references[name]
            publisher.publish(
                codec.encode(stamp, reference.position, reference.velocity, reference.acceleration)
            )
            self._sent += 1

    def _led(self) -> frozenset[str]:
        """Subtasks that the human leads, while the team is there and not stopped."""
        age = time.monotonic() - self._state_at
        if age > STALE or self._status.stopped:
            return frozenset()
        parameters = self._calls.parameters
        return frozenset(
            name for name in self._drivables if parameters.get(f"{name}.authority") == "human"
        )

    def _listen(self) -> None:
        if self._ear.listen_to_joints():
            self._state_at = time.monotonic()
        self._ear.listen_to_motions()

    def _show(self) -> None:
        """Sends a picture, and now and then plots and status."""
        now = time.monotonic()
        self._listen()
        ear = self._ear
        poses = self._stage.poses(ear.q, ear.state, ear.desired, ear.bodies)
        self._server.tell_all(picture(seconds(max(0, ear.stamp)), poses))
        if now - self._sampled_at >= SAMPLE_PERIOD:
            self._sampled_at = now
            ear.listen_to_energies()
            sample = self._stage.sample(seconds(max(0, ear.stamp)), ear.state, ear.desired)
            self._server.tell_all(json.dumps(sample | {"energy": ear.energy}))
        if now - self._told_at >= STATUS_PERIOD:
            self._told_at = now
            told = self._status.told(self._calls.parameters, self._state_at)
            told |= {
                "driver": self._seat.driver,
                "pages": self._server.pages,
                "held": getattr(self._switch.held(now), "subtask", None),
                "refill": self._calls.offers("refill"),
            }
            self._server.tell_all(json.dumps(told))

    def status(self) -> tuple[Level, str, dict[str, object]]:
        """Who drives, how many watch, what was refused."""
        held = self._switch.held(time.monotonic())
        values: dict[str, object] = {
            "pages": self._server.pages,
            "driver": self._seat.driver or "none",
            "held": held.subtask if held else "nothing",
            "references sent": self._sent,
            "refused connections": self._server.refused,
        }
        if self._seat.driver is None:
            return Level.OK, "nobody drives", values
        return Level.OK, f"driving {held.subtask}" if held else "nothing held", values

    def destroy_node(self) -> None:
        """Ends the server, then the node."""
        self._server.stop()
        self._listener.destroy_node()
        super().destroy_node()


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point."""
    return run_program(OperatorConsole, arguments)
