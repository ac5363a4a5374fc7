# SPDX-License-Identifier: Apache-2.0
"""Program `haptic_emulator`: an emulated human hand with a haptic device."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from std_msgs.msg import Float64MultiArray

from noninteract_ros.clock import seconds
from noninteract_ros.nodes.common.node import LOOP_QOS
from noninteract_ros.nodes.common.program import run_program
from noninteract_ros.nodes.messages.messages import EnergyCodec, Level
from noninteract_ros.nodes.sources.source import SourceNode
from noninteract_ros.sources.link.bilateral import BilateralLink, LinkAccount
from noninteract_ros.subtasks.reference import Reference


class HapticEmulator(SourceNode):
    """Leads a subtask as the human's source; a hand with a mass feels the subtask's feedback.

    Where a link lies between device and team, its account is published as `<subtask>/link`.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("haptic_emulator", **kwargs)
        stack = self.scenario.build_stack(self.scenario.build_team())
        device = self.scenario.build_haptic(stack)
        settings = self.scenario.haptic
        assert settings is not None  # build_haptic refuses a scenario without it.
        feels = settings.hand_mass > 0.0
        self._link = device if isinstance(device, BilateralLink) else None
        if self._link:
            general = self.scenario.general
            self._account_codec = EnergyCodec(("time", *LinkAccount._fields))
            self._account_every = 1.0 / min(general.telemetry_rate, settings.update_rate)
            self._account_due = -math.inf
            topic = f"{settings.subtask}/link"
            self._account_to = self.create_publisher(Float64MultiArray, topic, LOOP_QOS)
        self.speak_for(device, settings.subtask, "human", settings.update_rate, feels)

    def _encode(self, stamp: int, reference: Reference) -> bytes:
        self._tell_account(stamp)
        return super()._encode(stamp, reference)

    def _tell_account(self, stamp: int) -> None:
        """Publishes the link's account at the telemetry rate."""
        now = seconds(stamp)
        if self._link is None or (account := self._link.account) is None:
            return
        # A time that is far ahead of now is of a run that has ended.
        if -1.0 < now - self._account_due < -1e-9:
            return
        self._account_due = now + self._account_every
        self._account_to.publish(self._account_codec.encode(np.array([now, *account])))

    def status(self) -> tuple[Level, str, dict[str, object]]:
        """As any source, with the link's account."""
        level, text, values = super().status()
        account = self._link.account if self._link else None
        if account:
            values |= {f"link, {name}": value for name, value in account._asdict().items()}
        return level, text, values


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point."""
    return run_program(HapticEmulator, arguments)
