# SPDX-License-Identifier: Apache-2.0
"""Status of the stack, collected from `/diagnostics` for the pages."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray

from noninteract_ros.console.protocol import PageCommand
from noninteract_ros.nodes.common.team_status import PAUSED, TEAM, main_state
from noninteract_ros.subtasks.stack import SubtaskStack

STALE = 2.0  # [s] age of a program's diagnostics from which it is reported as missing
STALE_LEVEL = 3  # DiagnosticStatus.STALE
SETTLE = 1.2  # [s] for the diagnostics to show the effect of a service call
NO_STATES = 1.0  # [s] age of the team's state from which it is not live


@dataclass
class ProgramStatus:
    """Newest diagnostics of one program.

    Attributes:
        level: Level of its DiagnosticStatus.
        text: Its message.
        values: Its key-value pairs.
        received_at: Time of reception by the monotonic clock [s].
    """

    level: int
    text: str
    values: Mapping[str, str]
    received_at: float


class StackStatus:
    """Newest diagnostics of all programs.

    The effect of a successful service call is assumed until the diagnostics have had the time
    `SETTLE` to show it.

    Args:
        stack: The subtasks.
    """

    def __init__(self, stack: SubtaskStack) -> None:
        self._names = stack.names
        self._programs: dict[str, ProgramStatus] = {}
        self._expected: dict[str, tuple[bool, float]] = {}

    def update(self, message: DiagnosticArray) -> None:
        """Store a message of `/diagnostics`."""
        for item in message.status:
            self._programs[item.name.rpartition("/")[2]] = ProgramStatus(
                level=item.level[0],
                text=item.message,
                values={pair.key: pair.value for pair in item.values},
                received_at=time.monotonic(),
            )

    def expect(self, command: PageCommand) -> None:
        """Assume the effect of a command whose service call has succeeded."""
        until = time.monotonic() + SETTLE
        if command.kind in ("stop", "resume"):
            self._expected["stopped"] = (command.kind == "stop", until)
        elif command.kind == "pause":
            self._expected["paused"] = (command.values["on"], until)

    @property
    def stopped(self) -> bool:
        """True while the controller has stopped the team."""
        return self._is("stopped", "controller", "stopped")

    @property
    def paused(self) -> bool:
        """True while the simulation is paused."""
        return self._is("paused", TEAM, PAUSED)

    def _is(self, condition: str, program: str, text: str) -> bool:
        value, until = self._expected.get(condition, (False, 0.0))
        if time.monotonic() < until:
            return value
        return program in self._programs and main_state(self._programs[program].text) == text

    def message(self, parameters: Mapping[str, Any], state_at: float) -> dict[str, Any]:
        """Return the message `status` for pages.

        Args:
            parameters: Law, authority and gains, as last read from the controller.
            state_at: Time when the last state was received, by the monotonic clock [s].
        """
        controller = self._programs.get("controller")
        values = controller.values if controller else {}
        now = time.monotonic()
        return {
            "kind": "status",
            "law": parameters.get("law"),
            "stopped": self.stopped,
            "paused": self.paused,
            "live": now - state_at < NO_STATES,
            "subtasks": {
                name: {
                    "authority": parameters.get(f"{name}.authority"),
                    "silent": values.get(f"{name} led by", "").endswith("silent"),
                    "stiffness": parameters.get(f"{name}.stiffness"),
                    "damping": parameters.get(f"{name}.damping"),
                }
                for name in self._names
            },
            "programs": [
                {"name": name, **_summary(program, now)}
                for name, program in sorted(self._programs.items())
            ],
        }


def _summary(program: ProgramStatus, now: float) -> dict[str, Any]:
    age = now - program.received_at
    if age > STALE:
        text = f"no diagnostics for {age:.0f} s; last: {program.text}"
        return {"level": STALE_LEVEL, "text": text}
    return {"level": program.level, "text": program.text}
