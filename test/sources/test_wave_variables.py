# SPDX-License-Identifier: Apache-2.0
"""Wave variables: energy of waves, matched ends, and selection by the scenario."""

import numpy as np
import pytest

from noninteract_ros.schema import load
from noninteract_ros.sources.link.bilateral import ENDS
from noninteract_ros.sources.link.energy_budget import Packet
from noninteract_ros.sources.link.settings import LinkSettings
from noninteract_ros.sources.link.time_domain_passivity import ObservedDevice
from noninteract_ros.sources.link.wave_variables import WaveDevice, WaveTeam
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference

PERIOD = 1e-3
METRIC = np.array([1.0, 1.0, 1.0, 0.02, 0.02, 0.02])
POSE = Layout((3,), (True,))
RICH = LinkSettings(passivity="waves", impedance=30.0, reserve=50.0, capacity=100.0, delay=0.1)


def test_power_at_the_device_is_that_of_its_waves() -> None:
    """-f' v = (u' u - w' w) / 2 without an active limit."""
    rng = np.random.default_rng(1)
    device = WaveDevice(RICH, METRIC, PERIOD)
    for number in range(20):
        wave, velocity = rng.normal(size=(2, 6))
        device.receive(Packet(number, (wave,), 50.0, 50.0))
        force = device.force(velocity)
        motion = Reference(POSE.identity, velocity, np.zeros(6))
        sent = device.observe(force, PERIOD * velocity, motion).signals[1]
        assert -force @ velocity == pytest.approx(0.5 * (sent @ sent - wave @ wave))


def test_power_at_the_team_is_that_of_its_waves() -> None:
    """F' v = (u' u - w' w) / 2 once the smoothing has settled."""
    rng = np.random.default_rng(2)
    start = Reference.at_rest(POSE.identity, POSE)
    for _ in range(5):
        team = WaveTeam(RICH, POSE, METRIC, PERIOD, start)
        wave, feedback = rng.normal(size=(2, 6))
        for number in range(300):
            place = team._now.position  # No position difference.
            team.receive(Packet(number, (place, wave), 50.0, 50.0))
            velocity = team.advance(feedback).velocity
        (back,) = team.packet(feedback).signals
        assert -feedback @ velocity == pytest.approx(0.5 * (wave @ wave - back @ back), rel=1e-4)


def test_a_matched_team_reflects_no_wave_and_the_feedback_is_the_impedance() -> None:
    """A damper of the link's impedance at the team is a damper at the hand, at any delay."""
    start = Reference.at_rest(POSE.identity, POSE)
    device, team = WaveDevice(RICH, METRIC, PERIOD), WaveTeam(RICH, POSE, METRIC, PERIOD, start)
    velocity = np.array([0.2, 0.0, 0.1, 0.0, 1.0, 0.0])
    place, reference = POSE.identity, start
    for _ in range(400):
        feedback = -30.0 * METRIC * reference.velocity
        device.receive(team.packet(feedback))
        force = device.force(velocity)
        place = POSE.sum(place, PERIOD * velocity)
        motion = Reference(place, velocity, np.zeros(6))
        packet = device.observe(force, PERIOD * velocity, motion)
        # The wave alone, with the position of the team.
        team.receive(packet._replace(signals=(reference.position, packet.signals[1])))
        reference = team.advance(feedback)
    np.testing.assert_allclose(reference.velocity, velocity, atol=1e-3)
    np.testing.assert_allclose(force, -30.0 * METRIC * velocity, atol=0.02)


def test_the_passivity_key_selects_the_ends() -> None:
    """Each allowed value has its ends."""
    for name, kind in (("none", ObservedDevice), ("tdpa", ObservedDevice), ("waves", WaveDevice)):
        assert ENDS[load(LinkSettings, {"passivity": name}, "link").passivity][0] is kind
    assert len(ENDS) == 3
