# SPDX-License-Identifier: Apache-2.0
"""Program `haptic_emulator`: emulated human hand with a haptic device."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from std_msgs.msg import Float64MultiArray

from noninteract_ros.clock import seconds
from noninteract_ros.nodes.common.guarded_node import LOOP_QOS
from noninteract_ros.nodes.common.program import run_program
from noninteract_ros.nodes.messages.messages import EnergyCodec, Level
from noninteract_ros.nodes.sources.source import SourceNode
from noninteract_ros.sources.link.bilateral import BilateralLink, LinkAccount
from noninteract_ros.subtasks.reference import Reference


class HapticEmulator(SourceNode):
    """Node that commands a subtask as its human source.

    A hand with a mass uses the feedback of the subtask. With a link between device and team, the
    account of the link is published on `<subtask>/link`.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("haptic_emulator", **kwargs)
        device = self.scenario.build_haptic(self.scenario.stack)
        settings = self.scenario.haptic
        assert settings is not None  # build_haptic raises without this block.
        uses_feedback = settings.hand_mass > 0.0
        self._link = device if isinstance(device, BilateralLink) else None
        if self._link:
            general = self.scenario.general
            self._account_codec = EnergyCodec(("time", *LinkAccount._fields))
            self._account_period = 1.0 / min(general.telemetry_rate, settings.update_rate)
            self._account_due = -math.inf
            topic = f"{settings.subtask}/link"
            self._account_publisher = self.create_publisher(Float64MultiArray, topic, LOOP_QOS)
        self.set_up_source(device, settings.subtask, "human", settings.update_rate, uses_feedback)

    def _encode(self, stamp: int, reference: Reference) -> bytes:
        self._publish_account(stamp)
        return super()._encode(stamp, reference)

    def _publish_account(self, stamp: int) -> None:
        """Publish the account of the link at the telemetry rate."""
        now = seconds(stamp)
        if self._link is None or (account := self._link.account) is None:
            return
        # A due time far ahead of now belongs to an earlier run.
        if -1.0 < now - self._account_due < -1e-9:
            return
        self._account_due = now + self._account_period
        self._account_publisher.publish(self._account_codec.encode(np.array([now, *account])))

    def status(self) -> tuple[Level, str, dict[str, object]]:
        """Return the status of the source with the account of the link."""
        level, text, values = super().status()
        account = self._link.account if self._link else None
        if account:
            values |= {f"link, {name}": value for name, value in account._asdict().items()}
        return level, text, values


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program."""
    return run_program(HapticEmulator, arguments)
