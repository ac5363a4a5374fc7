# SPDX-License-Identifier: Apache-2.0
"""Whether the team's time stands on purpose, which only a simulated team can tell."""

import time

from diagnostic_msgs.msg import DiagnosticArray

from noninteract_ros.nodes.common.node import DIAGNOSTICS_PERIOD, ScenarioNode

TEAM = "robot_team"
# What the team says of itself then, its whole sentence.
PAUSED, FINISHED = "paused", "finished"
REASONS = {PAUSED: "the team is paused", FINISHED: "the team has finished"}
SILENT = 4.0 * DIAGNOSTICS_PERIOD  # [s] after which a team that said so is believed to be gone


class TeamStatus:
    """Hears in the diagnostics why the simulated team sends no states, as long as it lives.

    Args:
        node: Node that subscribes.
    """

    def __init__(self, node: ScenarioNode) -> None:
        self._name = node.resolve_topic_name(TEAM)
        self._reason, self._heard_at = "", 0.0
        node.subscribe(DiagnosticArray, "/diagnostics", self._take)

    def _take(self, message: DiagnosticArray) -> None:
        for item in message.status:
            if item.name == self._name:
                self._reason = REASONS.get(item.message, "")
                self._heard_at = time.monotonic()

    @property
    def reason(self) -> str:
        """Why it stands, in words; empty, where it does not, or is not heard of any more."""
        return self._reason if time.monotonic() - self._heard_at < SILENT else ""
