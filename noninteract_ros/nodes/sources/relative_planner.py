# SPDX-License-Identifier: Apache-2.0
"""Program `relative_planner`: autonomy that plans the formation."""

from collections.abc import Sequence
from typing import Any

from noninteract_ros.nodes.common.program import run_program
from noninteract_ros.nodes.sources.source import SourceNode


class RelativePlanner(SourceNode):
    """Leads a subtask as the autonomous source."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("relative_planner", **kwargs)
        stack = self.scenario.build_stack(self.scenario.build_team())
        planner = self.scenario.build_planner(stack)
        settings = self.scenario.planner
        assert settings is not None  # build_planner refuses a scenario without it.
        self.speak_for(planner, settings.subtask, "autonomy", settings.update_rate)


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point."""
    return run_program(RelativePlanner, arguments)
