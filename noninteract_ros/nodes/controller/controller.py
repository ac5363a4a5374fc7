# SPDX-License-Identifier: Apache-2.0
"""Program `controller`: the central decoupling controller."""

import time
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from noninteract_ros.arrays import Array
from noninteract_ros.clock import seconds
from noninteract_ros.control.controller import TeamController
from noninteract_ros.control.references.inputs import HORIZON, SOURCES, Force, MotionInput
from noninteract_ros.errors import InputError
from noninteract_ros.nodes.common.lockstep import SourceWatch, StampOrder, state_lead
from noninteract_ros.nodes.common.node import ScenarioNode, Ticker
from noninteract_ros.nodes.common.program import run_program
from noninteract_ros.nodes.common.team_status import TeamStatus
from noninteract_ros.nodes.controller.authority import AuthorityTopics
from noninteract_ros.nodes.controller.diagnostics import ControllerDiagnostics
from noninteract_ros.nodes.controller.parameters import LiveParameters
from noninteract_ros.nodes.controller.source_topics import listen
from noninteract_ros.nodes.controller.team_link import TeamLink
from noninteract_ros.nodes.controller.telemetry import Telemetry
from noninteract_ros.nodes.messages.messages import Level, SubtaskCodec, stamp_ns

WATCH_PERIOD = 0.1  # [s] how often absent lockstep sources and planned hand-overs are looked for
BRAKE_TIME = 2.0  # [s] given to effort-controlled robots to come to rest when the program ends
AT_REST = 1e-3  # [m/s or rad/s]
WAIT_SHOWN = 0.3  # [s] of waiting for something that is worth a word


class Controller(ScenarioNode):
    """Answers each state of the team with the torques of the law.

    Callbacks only queue what they received; the loop, or in lockstep the callback itself, works
    it off before the next tick, so that the core is touched by one thread.
    """

    LIVE = True

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("controller", **kwargs)
        general = self.scenario.general
        self.get_logger().info("preparing the law; its first start on a machine takes a while")
        team = self.scenario.build_team()
        stack = self.scenario.build_stack(team)
        self.core: TeamController = self.scenario.build_controller(team, stack)
        self.core.prepare()
        self._queue: deque[Callable[[], None]] = deque()
        self._state: tuple[int, Array, Array, Array | None] | None = None
        self._state_at = self._waiting_since = -np.inf
        self._order, self._lead = StampOrder(), state_lead(general.rate)
        self._missing: list[str] = []
        self._answered: int | None = None
        self._put_back: int | None = None
        self._stop_asked = False
        self._now = 0.0
        self._telemetry = Telemetry(self, team, stack)
        self._chronicle = ControllerDiagnostics(self, self.core, self._telemetry)
        self._live = LiveParameters(
            self, self.core, self._post, self._chronicle.changed, self._configuration
        )
        self._authority = AuthorityTopics(self, stack.names)
        self._standing = TeamStatus(self)
        self._watch = SourceWatch(
            general.lockstep_sources if self.lockstep else (),
            self.core.inputs,
            general.lockstep_timeout,
        )
        self._link = TeamLink(self, team, self._take_state)
        self.subscribe(Header, "put_back", self._on_put_back)
        for subtask in stack.subtasks:
            codec = SubtaskCodec(subtask.name, subtask.elements, subtask.axes, subtask.rotates)
            for source in SOURCES:
                listen(self, codec, source, self._take_input)
        self.create_service(Trigger, "~/stop", self._on_stop)
        self.create_service(Trigger, "~/resume", self._on_resume)
        self.create_service(Trigger, "~/refill", self._on_refill)
        if self.lockstep:
            self.every(WATCH_PERIOD, self._answer_if_complete)
        self.every(WATCH_PERIOD, self._live.follow_authority)

    def _take_input(
        self, topic: str, subtask: str, source: str, parsed: tuple[int, MotionInput | Force | None]
    ) -> None:
        self._post(partial(self._receive, topic, subtask, source, parsed))

    def _post(self, work: Callable[[], None]) -> None:
        """Has the thread of the core do something before its next tick."""
        self._queue.append(work)
        if self.lockstep:
            self._work_off()
            self._answer_if_complete()

    def _work_off(self) -> None:
        while self._queue:
            self._queue.popleft()()

    def _receive(
        self, topic: str, subtask: str, source: str, parsed: tuple[int, MotionInput | Force | None]
    ) -> None:
        """Hands an input to the core, or notes that a source has none."""
        if not self._team_is_there():
            return  # Its time is not known; in lockstep sources say again what is needed.
        stamp, item = parsed
        heard = self.core.inputs[subtask].sources[source]
        when = seconds(stamp)
        if self._watch.begins_ahead(f"{subtask}/{source}", when, self._now):
            return
        if item is None:
            heard.mark_complete_until(when)
            return
        if self.lockstep and self._now <= when < seconds(self._order.last(topic)):
            return  # A source that saw the state again says again what it has said.
        # Without a stamp, or by another clock than the team's, an input holds from now on.
        at_once = stamp == 0 or not self.lockstep
        try:
            if stamp:
                self._order.check(topic, stamp, float("inf") if self.lockstep else HORIZON)
            heard.receive(self._now if at_once else when, item, self._now)
        except InputError as error:
            self.refuse(topic, str(error))
            return
        if stamp:
            self._order.note(topic, stamp)

    def _team_is_there(self) -> bool:
        age = time.monotonic() - self._state_at
        fresh = self.lockstep or age <= self.scenario.general.state_timeout
        return self._state is not None and fresh

    def _take_state(self, stamp: int, positions: Array, v: Array) -> None:
        """Takes joint positions and velocities (n,) of the team at a stamp [ns]."""
        q = self.core.team.configuration_from_joints(positions)
        if self._order.take("joint_states", stamp, self._lead):
            self._begin_anew(stamp)
        self._state_at = time.monotonic()
        if stamp == self._answered:
            if self.lockstep:  # The team has not seen the answer.
                self._link.repeat()
            return
        if self._state is None or stamp != self._state[0]:
            self._waiting_since = self._state_at
        # In lockstep it can only be the last answer.
        self._state = (stamp, q, v, None if self.lockstep else self._link.applied)
        if self.lockstep:
            self._answer_if_complete()

    def _on_put_back(self, message: Header) -> None:
        """The team is at its start again from a state on, while its time goes on."""
        self._put_back = stamp_ns(message.stamp)

    def _configuration(self) -> Array | None:
        state = self._state
        return None if state is None else state[1]

    def _begin_anew(self, stamp: int) -> None:
        """The team was started anew: what was heard belongs to its former life."""
        self._state = self._answered = self._put_back = None
        self._order.forget()
        self._order.note("joint_states", stamp)
        self._telemetry.forget()
        self._post(self.core.reset)

    def _answer_if_complete(self) -> None:
        """Lockstep: answers the state once all that belongs to its tick has come."""
        if self._state is None or self._answered == self._state[0]:
            return
        self._now = seconds(self._state[0])
        self._missing = self._watch.missing(self._now, self._waiting_since)
        if not self._missing:
            self._missing = self._telemetry.missing(self._state[0])
        if not self._missing:
            self._answer(*self._state)

    def _answer(self, stamp: int, q: Array, v: Array, applied: Array | None) -> None:
        began = time.perf_counter()
        if self._put_back is not None and stamp >= self._put_back:
            self._put_back = None
            self.core.put_back()
        tick = self.core.step(seconds(stamp), q, v, applied, self._telemetry.wrenches)
        self._link.answer(stamp, tick)
        self._answered = stamp
        self._telemetry.publish(stamp, self.core, tick)
        self._chronicle.note(seconds(stamp), tick)
        self._chronicle.cycle_times.append(time.perf_counter() - began)

    def loop(self) -> None:
        """Wall time: answers the newest state once per period."""
        ticker = Ticker(self.scenario.general.rate)
        while self.context.ok() and not self.told_to_stop():
            ticker.wait()
            self.turn()
        if self.context.ok() and self._link.efforts:
            self._end(ticker)

    def _end(self, ticker: Ticker) -> None:
        """Brakes the team, for effort controllers would hold the last torques for ever."""
        self._post(self.core.stop)
        end = time.monotonic() + BRAKE_TIME
        while self._state is not None and np.abs(self._state[2]).max() > AT_REST:
            if time.monotonic() > end:
                break
            ticker.wait()
            self.turn()
        self._link.efforts.end()

    @property
    def has_last_words(self) -> bool:
        """Whether it has robots to brake before it ends."""
        return self.has_loop and bool(self._link.efforts)

    def turn(self) -> None:
        """Wall time: does what has come in, and answers the newest state unless it is answered."""
        self._link.poll()
        self._keep_still(self.descriptions.problem or self._link.problem())
        state = self._state
        if state is not None:
            self._now = seconds(state[0])
        self._work_off()
        if state is not None and self._answered != state[0]:
            self._answer(*state)

    def on_description_changed(self) -> None:
        """The law has another model than the robots: they are held still until a restart."""
        if self.lockstep:
            self._keep_still(self.descriptions.problem)

    def _keep_still(self, problem: str) -> None:
        """Holds the team still, as a stop does, while there is a problem that may go by itself."""
        if problem == self._chronicle.problem:
            return
        self._chronicle.problem = problem
        if problem:
            self.get_logger().error(f"holding the team still: {problem}")
            if not self.core.mode.stopped:
                self.core.stop()
            return
        self.get_logger().info("no longer holding the team still")
        if not self._stop_asked:
            self.core.resume()

    def _on_stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._stop_asked = True
        self._post(self.core.stop)
        return self._done(response, "stopped")

    def _on_refill(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._post(self.core.gate.refill)
        return self._done(response, "energy tank filled")

    def _on_resume(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._stop_asked = False
        if problem := self._chronicle.problem:
            response.success, response.message = False, f"held still: {problem}"
            return response
        self._post(self.core.resume)
        return self._done(response, "running")

    def _done(self, response: Trigger.Response, text: str) -> Trigger.Response:
        self.get_logger().info(text)
        response.success, response.message = True, text
        return response

    def status(self) -> tuple[Level, str, dict[str, object]]:
        """State machine, cycle times, condition of the subtasks, silent sources."""
        now = time.monotonic()
        if self._state is None:
            age, waiting = None, self._link.waiting_for()
        else:
            age = now - self._state_at
            waiting = self._missing if now - self._waiting_since > WAIT_SHOWN else []
        standing = self._standing.reason
        return self._chronicle.status(self._now, age, standing, waiting, self._watch.absent)


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point."""
    return run_program(Controller, arguments)
