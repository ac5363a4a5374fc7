# SPDX-License-Identifier: Apache-2.0
"""Program `relative_planner`: autonomous planner of the formation."""

from collections.abc import Sequence
from typing import Any

from noninteract_ros.nodes.common.program import run_program
from noninteract_ros.nodes.sources.source import SourceNode


class RelativePlanner(SourceNode):
    """Node that commands a subtask as its autonomous source."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("relative_planner", **kwargs)
        planner = self.scenario.build_planner(self.scenario.stack)
        settings = self.scenario.planner
        assert settings is not None  # build_planner raises without this block.
        self.set_up_source(planner, settings.subtask, "autonomy", settings.update_rate)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program."""
    return run_program(RelativePlanner, arguments)
