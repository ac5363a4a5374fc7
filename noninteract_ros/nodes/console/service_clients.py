# SPDX-License-Identifier: Apache-2.0
"""Clients of the services and parameters that pages use."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_parameter_events
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from noninteract_ros.console.protocol import PageCommand

RESPONSE_TIMEOUT = 3.0  # [s]
TRIGGERS = {
    "stop": "controller/stop",
    "resume": "controller/resume",
    "refill": "controller/refill",
    "step": "robot_team/step",
    "reset": "robot_team/reset",
}

ResponseCallback = Callable[[bool, str], None]


@dataclass
class PendingCall:
    """Service call without a response so far.

    Attributes:
        kind: Kind of the command.
        future: Future of the response.
        callback: Receives success and text.
        sent_at: Time of the call by the monotonic clock [s].
    """

    kind: str
    future: Future
    callback: ResponseCallback
    sent_at: float = field(default_factory=time.monotonic)


class ServiceClients:
    """Clients of the controller and the simulated team; `poll` delivers the responses.

    Args:
        node: The console's node.
        subtasks: Names of the subtasks.

    Attributes:
        parameters: Law, and authority and gains of each subtask, as last read.
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
            ParameterEvent,
            "/parameter_events",
            self._on_parameter_event,
            qos_profile_parameter_events,
        )
        keys = ("authority", "stiffness", "damping")
        self._names = ["law", *(f"{task}.{key}" for task in subtasks for key in keys)]
        self._pending: list[PendingCall] = []
        self._reading: Future | None = None
        self._read_at = 0.0
        self.parameters: dict[str, Any] = {}

    def is_available(self, kind: str) -> bool:
        """Return True if the service of a command is available."""
        return bool(self._triggers[kind].service_is_ready())

    def send(self, command: PageCommand, callback: ResponseCallback) -> None:
        """Send a command to its service.

        Args:
            command: Command of a page.
            callback: Receives success and text; called by `poll`, or at once where the service is
                not available.
        """
        if command.kind in self._triggers:
            self._call(command.kind, self._triggers[command.kind], Trigger.Request(), callback)
        elif command.kind == "pause":
            request = SetBool.Request(data=command.values["on"])
            self._call("pause", self._pause, request, callback)
        else:
            name, value = _parameter(command)
            parameter = Parameter(name, value=value).to_parameter_msg()
            request = SetParametersAtomically.Request(parameters=[parameter])
            self._call(command.kind, self._set, request, callback)

    def _call(self, kind: str, client: Any, request: Any, callback: ResponseCallback) -> None:
        if not client.service_is_ready():
            callback(False, f"{kind}: service {client.srv_name} is not available")
            return
        self._pending.append(PendingCall(kind, client.call_async(request), callback))

    def poll(self) -> None:
        """Deliver responses and time-outs to their callbacks."""
        for call in list(self._pending):
            timed_out = time.monotonic() - call.sent_at > RESPONSE_TIMEOUT
            if call.future.done() or timed_out:
                self._pending.remove(call)
                response = call.future.result() if call.future.done() else None
                ok, text = _result(response) if response is not None else (False, "no response")
                call.callback(ok, f"{call.kind}: {text}")
                self._read_at = 0.0

    def _on_parameter_event(self, event: ParameterEvent) -> None:
        """Read the parameters again when one has changed."""
        if event.node == self._controller:
            self._read_at = 0.0

    def read_parameters(self, period: float) -> None:
        """Read the controller's parameters once per period [s] without blocking."""
        now = time.monotonic()
        if self._reading is not None and self._reading.done():
            values = getattr(self._reading.result(), "values", [])
            if len(values) == len(self._names):
                named = zip(self._names, values, strict=True)
                messages = [ParameterMessage(name=name, value=value) for name, value in named]
                found = map(Parameter.from_parameter_msg, messages)
                self.parameters = {item.name: _plain(item.value) for item in found}
            self._reading = None
        if self._reading is not None and now - self._read_at < RESPONSE_TIMEOUT:
            return
        if now - self._read_at >= period and self._get.service_is_ready():
            self._read_at = now
            self._reading = self._get.call_async(GetParameters.Request(names=self._names))


def _result(response: Any) -> tuple[bool, str]:
    """Return success and text of a service response."""
    result = getattr(response, "result", None)
    if result is not None:
        return result.successful, "done" if result.successful else result.reason
    return response.success, response.message


def _parameter(command: PageCommand) -> tuple[str, Any]:
    """Return name and value of the parameter that a command sets."""
    values = command.values
    if command.kind == "law":
        return "law", values["law"]
    if command.kind == "authority":
        return f"{values['subtask']}.authority", values["source"]
    return f"{values['subtask']}.{values['name']}", [float(item) for item in values["values"]]


def _plain(value: Any) -> Any:
    return value if value is None or isinstance(value, str | float | int) else list(value)
