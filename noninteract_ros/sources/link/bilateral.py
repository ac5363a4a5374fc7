# SPDX-License-Identifier: Apache-2.0
"""An operator's device that is connected to the team by a link, both ways.

One tick: the feedback is sent off, what has arrived at the device acts on the hand, the motion
that results is sent off, what has arrived at the team's end becomes the reference.
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

LONGEST_GAP = 0.1  # [s] after a longer one without samples the link is taken up again

ENDS: dict[str, tuple[type[ObservedDevice], type[ObservedTeam]]] = {
    "none": (ObservedDevice, ObservedTeam),
    "tdpa": (ObservedDevice, ObservedTeam),
    "waves": (WaveDevice, WaveTeam),
}


class LinkAccount(NamedTuple):
    """The energy account of a link since the run began.

    Attributes:
        operator_in: Energy that the hand has put in [J].
        operator_out: Energy that the hand has got out [J].
        team_in: Energy that the team's impedance has got [J].
        team_out: Energy that it has given back [J].
        device_budget: What the device may still give to the hand [J].
        team_budget: What may still be given to the team's impedance [J].
        surprise: How far motions that the device's end did not expect can have overdrawn it [J].
        lost: Packets that never arrive, both ways.
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
        """Energy put in by the hand less what it got out [J]: at least -(reserve + surprise)."""
        return self.operator_in - self.operator_out


class BilateralLink:
    """A device whose motion reaches the team, and the team's feedback the device, over a link.

    Args:
        device: The device in the operator's hand.
        haptic: Its settings; the hand has a mass.
        settings: The link.
        layout: Layout of the commanded subtask's values.
        path: Dotted key of the link's block, for error messages.

    Raises:
        ScenarioError: The hand is rigid, so that it can feel nothing.
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
        """The energies so far; None before the first sample."""
        if self._index is None:
            return None
        hand, team = self._device_end.port, self._team_end.port
        return LinkAccount(
            hand.taken,
            hand.given,
            team.given,
            team.taken,
            self._device_end.budget.level,
            self._team_end.budget.level,
            self._device_end.surprise,
            float(self._to_team.lost + self._to_device.lost),
        )

    @property
    def device_motion(self) -> Reference:
        """The device's motion at the last sample."""
        return self._motion

    def sample(self, t: float, feedback: Array | None = None) -> Reference | None:
        """The reference that the team's end makes for an update instant.

        Args:
            t: Time [s], taken to the nearest update instant.
            feedback: Force that the team's impedance reflects [N; N m], shape (dim,).

        Returns:
            The reference; None where the device does not speak.

        Raises:
            InputError: The feedback has another shape or is not finite.
        """
        index = round(t * self._rate)
        force = self._settings.force_scale * self._device.checked(feedback)
        before = self._index
        if before is None or not 0 <= index - before <= LONGEST_GAP * self._rate:
            return self._begin(index)
        reference: Reference | None = self._reference
        for tick in range(before, index):
            reference = self._tick(tick, force)
        return reference

    def next_update(self, t: float) -> float:
        """The first update instant later than `t` [s], spoken or not."""
        return self._device.next_update(t)

    def silent_until(self, t: float) -> float:
        """The first instant later than `t` [s] for which there is a sample; infinity if none."""
        return self._device.silent_until(t)

    def _begin(self, index: int) -> Reference | None:
        """Starts where the device is; after a break with the energy that was left."""
        motion = self._device.sample(index / self._rate)
        if motion is None:
            self._index = None
            return None
        self._to_team.reset()
        self._to_device.reset()
        if index < self._latest:
            self._new_ends(motion)
        self._device_end.resume()
        self._team_end.resume(motion)
        self._index = self._latest = index
        self._motion = self._reference = motion
        return motion

    def _new_ends(self, motion: Reference) -> None:
        settings, period = self._settings, 1.0 / self._rate
        limited = self._device.limited
        device, team = ENDS[settings.passivity]
        self._device_end = device(settings, self._metric, period, limited)
        self._team_end = team(settings, self._layout, self._metric, period, motion)

    def _tick(self, tick: int, feedback: Array) -> Reference | None:
        now, later = tick / self._rate, (tick + 1) / self._rate
        self._to_device.send(now, self._team_end.packet(feedback))
        for packet in self._to_device.receive(now):
            self._device_end.hear(packet)
        force = self._device_end.force(self._motion.velocity)
        motion = self._device.sample(later, force)
        if motion is None:
            self._index = None
            return None
        way = self._layout.difference(motion.position, self._motion.position)
        self._to_team.send(later, self._device_end.moved(force, way, motion))
        for packet in self._to_team.receive(later):
            self._team_end.hear(packet)
        self._index = self._latest = tick + 1
        self._motion = motion
        self._reference = self._team_end.advance(feedback)
        return self._reference
