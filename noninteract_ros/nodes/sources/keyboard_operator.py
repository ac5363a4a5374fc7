# SPDX-License-Identifier: Apache-2.0
"""Program `keyboard_operator`: rate commands from the keys of a terminal."""

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
    """Node that commands rates while keys are held.

    A closed terminal shuts the node down.

    Args:
        terminal: File descriptor of the terminal; by default standard input.
        kwargs: Arguments of `rclpy.node.Node`.

    Raises:
        ScenarioError: Standard input is not a terminal.
    """

    def __init__(self, terminal: int | None = None, **kwargs: Any) -> None:
        super().__init__("keyboard_operator", **kwargs)
        self._terminal = sys.stdin.fileno() if terminal is None else terminal
        if not os.isatty(self._terminal):
            raise ScenarioError("(terminal)", "none on standard input", "a terminal")
        self._keys = KeyState(self.scenario.keyboard or KeyboardSettings())
        self._terminal_settings = termios.tcgetattr(self._terminal)
        tty.setcbreak(self._terminal)
        self.create_wall_timer(READ_PERIOD, self._read_keys)
        print(HELP, flush=True)

    def _read_keys(self) -> None:
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

    def command(self, now: float, desired: Reference) -> None:
        """Publish a rate in the directions of the held keys."""
        self.publish_rate(self.input.rate(self._keys.stick(now), desired))

    def destroy_node(self) -> None:
        """Destroy the node and restore the terminal settings."""
        settings = getattr(self, "_terminal_settings", None)
        if settings is not None:
            with suppress(termios.error):  # The terminal may be closed.
                termios.tcsetattr(self._terminal, termios.TCSADRAIN, settings)
        super().destroy_node()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program."""
    return run_program(KeyboardOperator, arguments)
