# SPDX-License-Identifier: Apache-2.0
"""Program `keyboard_operator`: keys of a terminal that lead a subtask by rates."""

import os
import select
import sys
import termios
import time
import tty
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from noninteract_ros.errors import ScenarioError
from noninteract_ros.nodes.common.program import run_program
from noninteract_ros.nodes.sources.operator_node import OperatorNode
from noninteract_ros.sources.human.input_settings import KeyboardSettings
from noninteract_ros.sources.human.key_state import HELP, QUIT, KeyState
from noninteract_ros.subtasks.reference import Reference

READ_PERIOD = 0.01  # [s]


class KeyboardOperator(OperatorNode):
    """Leads while keys are held; a terminal that is gone holds none.

    Args:
        terminal: File descriptor of the terminal; by default standard input.
        kwargs: Passed on to `rclpy.node.Node`.

    Raises:
        ScenarioError: There is no terminal.
    """

    def __init__(self, terminal: int | None = None, **kwargs: Any) -> None:
        super().__init__("keyboard_operator", **kwargs)
        self._terminal = sys.stdin.fileno() if terminal is None else terminal
        if not os.isatty(self._terminal):
            raise ScenarioError("(terminal)", "none on standard input", "a terminal")
        self._keys = KeyState(self.scenario.keyboard or KeyboardSettings())
        self._before = termios.tcgetattr(self._terminal)
        tty.setcbreak(self._terminal)
        self.every(READ_PERIOD, self._read)
        print(HELP, flush=True)

    def _read(self) -> None:
        now = time.monotonic()
        while select.select([self._terminal], [], [], 0.0)[0]:
            try:
                found = os.read(self._terminal, 64)
            except OSError:  # The terminal was closed.
                found = b""
            if not found:
                self.context.try_shutdown()
                return
            for key in found.decode(errors="replace").lower():
                if key == QUIT:
                    self.context.try_shutdown()
                    return
                self._keys.press(key, now)
        self.dead_man.update(now, bool(self._keys.stick(now).any()))

    def lead(self, now: float, desired: Reference) -> None:
        """A rate in the directions of the keys."""
        self.say_rate(self.input.rate(self._keys.stick(now), desired))

    def destroy_node(self) -> None:
        """Ends the node and gives the terminal back as it was."""
        before = getattr(self, "_before", None)
        if before is not None:
            with suppress(termios.error):  # The terminal may be gone.
                termios.tcsetattr(self._terminal, termios.TCSADRAIN, before)
        super().destroy_node()


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point."""
    return run_program(KeyboardOperator, arguments)
