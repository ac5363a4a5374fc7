# SPDX-License-Identifier: Apache-2.0
"""Program `joy_operator`: rate commands from a gamepad or space mouse."""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from sensor_msgs.msg import Joy

from noninteract_ros.arrays import Array
from noninteract_ros.nodes.common.program import run_program
from noninteract_ros.nodes.sources.operator_node import OperatorNode
from noninteract_ros.sources.human.input_settings import JoySettings
from noninteract_ros.sources.human.joy_mapping import JoyMapping
from noninteract_ros.subtasks.reference import Reference


class JoyOperator(OperatorNode):
    """Node that commands rates while the enable button is held.

    Without an enable button, it commands rates while the device is deflected. A device counts
    only once each mapped axis was in its dead zone.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("joy_operator", **kwargs)
        settings = self.scenario.joy or JoySettings()
        self._mapping = JoyMapping(settings)
        self._stick: Array = np.zeros(6)
        # Drivers report deflections that nobody holds until the first event of an axis.
        self._rested: Any = False
        self.subscribe(Joy, settings.topic, self._on_joy)

    def _on_joy(self, message: Joy) -> None:
        stick, held = self._mapping.read(message.axes, message.buttons)
        self._stick = stick
        self._rested = self._rested | self._mapping.at_rest(message.axes)
        self.dead_man.update(time.monotonic(), held and bool(np.all(self._rested)))

    def command(self, now: float, desired: Reference) -> None:
        """Publish a rate proportional to the deflection."""
        self.publish_rate(self.input.rate(self._stick, desired))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program."""
    return run_program(JoyOperator, arguments)
