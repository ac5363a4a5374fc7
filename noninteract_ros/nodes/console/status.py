# SPDX-License-Identifier: Apache-2.0
"""What all programs say of themselves, as the page shows it."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray

from noninteract_ros.console.protocol import PageCommand
from noninteract_ros.nodes.common.team_status import PAUSED, TEAM
from noninteract_ros.subtasks.stack import SubtaskStack

SILENT = 2.0  # [s] after which a program that told of itself no more is missed
SETTLE = 1.2  # [s] for diagnostics to catch up with what a service has answered
NO_STATES = 1.0  # [s]


@dataclass
class ProgramStatus:
    """Newest diagnostics of one program."""

    level: int
    text: str
    values: Mapping[str, str]
    at: float


class StackStatus:
    """Collects diagnostics; what a service has just done counts before they say so.

    Args:
        stack: The subtasks.
    """

    def __init__(self, stack: SubtaskStack) -> None:
        self._names = stack.names
        self._heard: dict[str, ProgramStatus] = {}
        self._expected: dict[str, tuple[bool, float]] = {}

    def note(self, message: DiagnosticArray) -> None:
        """Takes a message of `/diagnostics`."""
        for item in message.status:
            values = {pair.key: pair.value for pair in item.values}
            heard = ProgramStatus(item.level[0], item.message, values, time.monotonic())
            self._heard[item.name.rpartition("/")[2]] = heard

    def expect(self, said: PageCommand) -> None:
        """A service has done what a page asked for."""
        until = time.monotonic() + SETTLE
        if said.kind in ("stop", "resume"):
            self._expected["stopped"] = (said.kind == "stop", until)
        elif said.kind == "pause":
            self._expected["paused"] = (said.values["on"], until)

    @property
    def stopped(self) -> bool:
        """Whether the controller has stopped the team."""
        return self._is("stopped", "controller", "stopped")

    @property
    def paused(self) -> bool:
        """Whether the simulation is paused."""
        return self._is("paused", TEAM, PAUSED)

    def _is(self, what: str, node: str, text: str) -> bool:
        value, until = self._expected.get(what, (False, 0.0))
        if time.monotonic() < until:
            return value
        return node in self._heard and self._heard[node].text == text

    def told(self, parameters: Mapping[str, Any], state_at: float) -> dict[str, Any]:
        """The message `status` for pages.

        Args:
            parameters: What the controller said of law, authority and gains.
            state_at: When the team's state was last heard, by the monotonic clock [s].
        """
        controller = self._heard.get("controller")
        said = controller.values if controller else {}
        now = time.monotonic()
        return {
            "kind": "status",
            "law": parameters.get("law"),
            "stopped": self.stopped,
            "paused": self.paused,
            "there": now - state_at < NO_STATES,
            "subtasks": {
                name: {
                    "authority": parameters.get(f"{name}.authority"),
                    "silent": said.get(f"{name} led by", "").endswith("silent"),
                    "stiffness": parameters.get(f"{name}.stiffness"),
                    "damping": parameters.get(f"{name}.damping"),
                }
                for name in self._names
            },
            "programs": [
                {"name": name, **_words(heard, now)} for name, heard in sorted(self._heard.items())
            ],
        }


def _words(heard: ProgramStatus, now: float) -> dict[str, Any]:
    if now - heard.at > SILENT:
        return {"level": 3, "text": f"silent for {now - heard.at:.0f} s; before: {heard.text}"}
    return {"level": heard.level, "text": heard.text}
