# SPDX-License-Identifier: Apache-2.0
"""Program `haptic_emulator`: an emulated human hand with a haptic device."""

import sys
from collections.abc import Sequence
from typing import Any

from noninteract_ros.nodes.program import run_program
from noninteract_ros.nodes.source import SourceNode


class HapticEmulator(SourceNode):
    """Leads a subtask as the human's source; a hand with a mass feels the subtask's feedback."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("haptic_emulator", **kwargs)
        stack = self.scenario.build_stack(self.scenario.build_team())
        device = self.scenario.build_haptic(stack)
        settings = self.scenario.haptic
        assert settings is not None  # build_haptic refuses a scenario without it.
        feels = settings.hand_mass > 0.0
        self.speak_for(device, settings.subtask, "human", settings.update_rate, feels)


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point."""
    return run_program(HapticEmulator, arguments)


if __name__ == "__main__":
    sys.exit(main())
