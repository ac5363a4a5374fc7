# SPDX-License-Identifier: Apache-2.0
"""Status of the simulated team, from its diagnostics."""

import time

from diagnostic_msgs.msg import DiagnosticArray

from noninteract_ros.nodes.common.node import DIAGNOSTICS_PERIOD, ScenarioNode

TEAM = "robot_team"
# Messages in the diagnostics of the simulated team.
PAUSED, FINISHED = "paused", "finished"
REASONS = {PAUSED: "the team is paused", FINISHED: "the team has finished"}
STATUS_TIMEOUT = 4.0 * DIAGNOSTICS_PERIOD  # [s] without diagnostics after which it has ended


def main_state(message: str) -> str:
    """Return a status message without the problems that a node appends to it."""
    return message.partition("; ")[0]


class TeamStatus:
    """Subscription to the diagnostics of the simulated team.

    Distinguishes a paused or finished team from one whose states are missing.

    Args:
        node: Node that subscribes.
    """

    def __init__(self, node: ScenarioNode) -> None:
        self._name = node.resolve_topic_name(TEAM)
        self._reason, self._received_at = "", 0.0
        node.subscribe(DiagnosticArray, "/diagnostics", self._on_diagnostics)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for item in message.status:
            if item.name == self._name:
                self._reason = REASONS.get(main_state(item.message), "")
                self._received_at = time.monotonic()

    @property
    def reason(self) -> str:
        """Reason why the team sends no states on purpose; empty otherwise or after the timeout."""
        return self._reason if time.monotonic() - self._received_at < STATUS_TIMEOUT else ""
