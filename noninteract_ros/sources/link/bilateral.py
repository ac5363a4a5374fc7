# SPDX-License-Identifier: Apache-2.0
"""Bilateral link between an operator's device and the team.

One tick: send the feedback, apply the feedback that has arrived at the device to the hand, send
the resulting motion, turn the motion that has arrived at the team's end into the reference.
"""

import math
from typing import NamedTuple

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import ScenarioError
from noninteract_ros.sources.human.haptic_device import HapticDevice
from noninteract_ros.sources.human.haptic_settings import HapticSettings
from noninteract_ros.sources.link.channel import Channel
from noninteract_ros.sources.link.energy_budget import Packet
from noninteract_ros.sources.link.settings import LinkSettings
from noninteract_ros.sources.link.time_domain_passivity import ObservedDevice, ObservedTeam
from noninteract_ros.sources.link.wave_variables import WaveDevice, WaveTeam
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference

LONGEST_GAP = 0.1  # Time without samples [s] after which the link is re-established.

ENDS: dict[str, tuple[type[ObservedDevice], type[ObservedTeam]]] = {
    "none": (ObservedDevice, ObservedTeam),
    "tdpa": (ObservedDevice, ObservedTeam),
    "waves": (WaveDevice, WaveTeam),
}


class LinkAccount(NamedTuple):
    """Energy account of a link since the start of the run.

    Attributes:
        operator_in: Energy absorbed from the hand [J].
        operator_out: Energy delivered to the hand [J].
        team_in: Energy delivered to the team's impedance [J].
        team_out: Energy absorbed from the team's impedance [J].
        device_budget: Energy that may still be delivered to the hand [J].
        team_budget: Energy that may still be delivered to the team's impedance [J].
        surprise: Bound of the overdraft at the device's end by mispredicted displacements [J].
        lost: Count of lost packets, both directions.
    """

    operator_in: float
    operator_out: float
    team_in: float
    team_out: float
    device_budget: float
    team_budget: float
    surprise: float
    lost: float

    @property
    def operator_net(self) -> float:
        """Net energy absorbed from the hand [J]; at least -(reserve + surprise)."""
        return self.operator_in - self.operator_out


class BilateralLink:
    """Link that carries the device's motion to the team and the team's feedback to the device.

    Args:
        device: Device in the operator's hand.
        haptic: Settings of the device; the hand has a mass.
        settings: Settings of the link.
        layout: Layout of the commanded subtask's values.
        path: Dotted key of the link's block, for error messages.

    Raises:
        ScenarioError: The hand has no mass, so that feedback cannot act on it.
    """

    def __init__(
        self,
        device: HapticDevice,
        haptic: HapticSettings,
        settings: LinkSettings,
        layout: Layout,
        path: str = "link",
    ) -> None:
        if haptic.hand_mass <= 0.0:
            raise ScenarioError(
                "haptic.hand_mass", haptic.hand_mass, f"> 0, where there is a {path}"
            )
        self._device, self._settings, self._layout = device, settings, layout
        self._rate = haptic.update_rate
        self._metric = np.ones(layout.dim)
        self._metric[layout.angular] = haptic.hand_inertia / (
            haptic.hand_mass + haptic.device_mass
        )
        self._to_team: Channel[Packet] = Channel(settings, 0)
        self._to_device: Channel[Packet] = Channel(settings, 1)
        self._index: int | None = None
        self._latest = math.inf

    @property
    def account(self) -> LinkAccount | None:
        """Energies since the start of the run; None before the first sample."""
        if self._index is None:
            return None
        hand, team = self._device_end.port, self._team_end.port
        return LinkAccount(
            operator_in=hand.absorbed,
            operator_out=hand.delivered,
            team_in=team.delivered,
            team_out=team.absorbed,
            device_budget=self._device_end.budget.level,
            team_budget=self._team_end.budget.level,
            surprise=self._device_end.surprise,
            lost=float(self._to_team.lost + self._to_device.lost),
        )

    @property
    def device_motion(self) -> Reference:
        """Motion of the device at the last sample."""
        return self._motion

    def sample(self, t: float, feedback: Array | None = None) -> Reference | None:
        """Return the reference of the team's end for an update instant.

        Args:
            t: Time [s], rounded to the nearest update instant.
            feedback: Force that the team's impedance reflects [N; N m], shape (dim,).

        Returns:
            The reference; None where the device has no sample.

        Raises:
            InputError: The feedback has the wrong shape or is not finite.
        """
        index = round(t * self._rate)
        force = self._settings.force_scale * self._device.checked(feedback)
        before = self._index
        if before is None or not 0 <= index - before <= LONGEST_GAP * self._rate:
            return self._connect(index)
        reference: Reference | None = self._reference
        for tick in range(before, index):
            reference = self._tick(tick, force)
        return reference

    def next_update(self, t: float) -> float:
        """Return the first update instant after `t` [s], with or without a sample."""
        return self._device.next_update(t)

    def next_sample(self, t: float) -> float:
        """Return the first instant after `t` with a sample [s]; infinity if there is none."""
        return self._device.next_sample(t)

    def _connect(self, index: int) -> Reference | None:
        """Start at the device's motion; after an interruption, with the remaining energy."""
        motion = self._device.sample(index / self._rate)
        if motion is None:
            self._index = None
            return None
        self._to_team.reset()
        self._to_device.reset()
        if index < self._latest:
            self._create_ends(motion)
        self._device_end.resume()
        self._team_end.resume(motion)
        self._index = self._latest = index
        self._motion = self._reference = motion
        return motion

    def _create_ends(self, motion: Reference) -> None:
        settings, period = self._settings, 1.0 / self._rate
        saturate = self._device.saturate
        device, team = ENDS[settings.passivity]
        self._device_end = device(settings, self._metric, period, saturate)
        self._team_end = team(settings, self._layout, self._metric, period, motion)

    def _tick(self, tick: int, feedback: Array) -> Reference | None:
        now, later = tick / self._rate, (tick + 1) / self._rate
        self._to_device.send(now, self._team_end.packet(feedback))
        for packet in self._to_device.receive(now):
            self._device_end.receive(packet)
        force = self._device_end.force(self._motion.velocity)
        motion = self._device.sample(later, force)
        if motion is None:
            self._index = None
            return None
        displacement = self._layout.difference(motion.position, self._motion.position)
        self._to_team.send(later, self._device_end.observe(force, displacement, motion))
        for packet in self._to_team.receive(later):
            self._team_end.receive(packet)
        self._index = self._latest = tick + 1
        self._motion = motion
        self._reference = self._team_end.advance(feedback)
        return self._reference
