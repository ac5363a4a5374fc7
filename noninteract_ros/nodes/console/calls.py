# SPDX-License-Identifier: Apache-2.0
"""What the console asks of the other programs: services and parameters, with their answers."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_parameter_events
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from noninteract_ros.console.protocol import PageCommand

ANSWER_TIMEOUT = 3.0  # [s]
TRIGGERS = {
    "stop": "controller/stop",
    "resume": "controller/resume",
    "refill": "controller/refill",
    "step": "robot_team/step",
    "reset": "robot_team/reset",
}

Answer = Callable[[bool, str], None]
Taken = Callable[[Any], tuple[bool, str]]


@dataclass
class Pending:
    """A call that is not answered yet."""

    what: str
    future: Future
    taken: Taken
    answer: Answer
    since: float = field(default_factory=time.monotonic)


class Calls:
    """Services of the controller and the simulated team; answers come out of `poll`.

    Args:
        node: The console's node.
        subtasks: Names of the subtasks.

    Attributes:
        parameters: Law, and authority and gains of each subtask, as the controller last said.
    """

    def __init__(self, node: Node, subtasks: tuple[str, ...]) -> None:
        self._triggers = {
            kind: node.create_client(Trigger, name) for kind, name in TRIGGERS.items()
        }
        self._pause = node.create_client(SetBool, "robot_team/pause")
        self._get = node.create_client(GetParameters, "controller/get_parameters")
        self._set = node.create_client(
            SetParametersAtomically, "controller/set_parameters_atomically"
        )
        self._controller = node.resolve_topic_name("controller")
        node.create_subscription(
            ParameterEvent, "/parameter_events", self._on_event, qos_profile_parameter_events
        )
        keys = ("authority", "stiffness", "damping")
        self._names = ["law", *(f"{task}.{key}" for task in subtasks for key in keys)]
        self._pending: list[Pending] = []
        self._reading: Future | None = None
        self._read_at = 0.0
        self.parameters: dict[str, Any] = {}

    def offers(self, kind: str) -> bool:
        """Whether somebody offers the service for a kind of message."""
        return bool(self._triggers[kind].service_is_ready())

    def ask(self, said: PageCommand, answer: Answer) -> None:
        """Passes on what a page asks for.

        Args:
            said: The page's message.
            answer: Told whether it was done, and what to say; called by `poll`, or at once.
        """
        if said.kind in self._triggers:
            self._call(said.kind, self._triggers[said.kind], Trigger.Request(), answer)
        elif said.kind == "pause":
            self._call("pause", self._pause, SetBool.Request(data=said.values["on"]), answer)
        else:
            name, value = _parameter(said)
            parameter = Parameter(name, value=value).to_parameter_msg()
            request = SetParametersAtomically.Request(parameters=[parameter])
            self._call(said.kind, self._set, request, answer)

    def _call(self, what: str, client: Any, request: Any, answer: Answer) -> None:
        if not client.service_is_ready():
            answer(False, f"{what}: nobody offers {client.srv_name}")
            return
        self._pending.append(Pending(what, client.call_async(request), _taken, answer))

    def poll(self) -> None:
        """Hands out the answers that have come."""
        for item in list(self._pending):
            late = time.monotonic() - item.since > ANSWER_TIMEOUT
            if item.future.done() or late:
                self._pending.remove(item)
                done = item.future.done() and item.future.result() is not None
                ok, text = item.taken(item.future.result()) if done else (False, "no answer")
                item.answer(ok, f"{item.what}: {text}")
                self._read_at = 0.0

    def _on_event(self, event: ParameterEvent) -> None:
        """Somebody has changed something: it is read anew at once."""
        if event.node == self._controller:
            self._read_at = 0.0

    def read(self, period: float) -> None:
        """Asks for the parameters again and again, each period [s]."""
        now = time.monotonic()
        if self._reading is not None and self._reading.done():
            values = getattr(self._reading.result(), "values", [])
            if len(values) == len(self._names):
                found = map(Parameter.from_parameter_msg, _as_messages(self._names, values))
                self.parameters = {item.name: _plain(item.value) for item in found}
            self._reading = None
        if self._reading is not None and now - self._read_at < ANSWER_TIMEOUT:
            return
        if now - self._read_at >= period and self._get.service_is_ready():
            self._read_at = now
            self._reading = self._get.call_async(GetParameters.Request(names=self._names))


def _taken(response: Any) -> tuple[bool, str]:
    result = getattr(response, "result", None)
    if result is not None:
        return result.successful, "done" if result.successful else result.reason
    return response.success, response.message


def _parameter(said: PageCommand) -> tuple[str, Any]:
    values = said.values
    if said.kind == "law":
        return "law", values["law"]
    if said.kind == "authority":
        return f"{values['subtask']}.authority", values["source"]
    return f"{values['subtask']}.{values['name']}", [float(item) for item in values["values"]]


def _as_messages(names: list[str], values: list[Any]) -> list[Any]:
    from rcl_interfaces.msg import Parameter as Message

    return [Message(name=name, value=value) for name, value in zip(names, values, strict=True)]


def _plain(value: Any) -> Any:
    return value if value is None or isinstance(value, str | float | int) else list(value)
