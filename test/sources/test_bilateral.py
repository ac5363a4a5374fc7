# SPDX-License-Identifier: Apache-2.0
"""Bilateral link: samples, energy account and rotations."""

from typing import Any

import numpy as np
import pytest

from noninteract_ros.errors import ScenarioError
from noninteract_ros.schema import load
from noninteract_ros.sources.human.haptic_device import HapticDevice, HapticSettings
from noninteract_ros.sources.link.bilateral import BilateralLink
from noninteract_ros.sources.link.settings import LinkSettings
from noninteract_ros.subtasks.layout import Layout

PLANE = Layout.scalars(2)
POSE = Layout((3,), (True,))
HAND: dict[str, Any] = {"motion": "circle", "centre": [0.0, 0.0], "hand_mass": 0.5}
POSE_HAND: dict[str, Any] = {
    "motion": "circle",
    "centre": [0.0, 0.0, 0.0],
    "rotation": [0.3, 0.0, 0.5],
    "hand_mass": 0.5,
}


def linked(layout: Layout = PLANE, link: Any = None, **haptic: Any) -> BilateralLink:
    """Build a link from keys of a scenario file."""
    hand = HAND if layout.rates.size == 2 else POSE_HAND
    settings = load(HapticSettings, {**hand, **haptic}, "haptic")
    device = HapticDevice(settings, layout)
    return BilateralLink(device, settings, load(LinkSettings, link or {}, "link"), layout)


@pytest.mark.parametrize("layout", [PLANE, POSE], ids=["plane", "pose"])
def test_the_reference_is_the_device_s_motion_a_delay_ago(layout: Layout) -> None:
    """The reference is the delayed device motion, in free motion without feedback."""
    link = linked(layout, {"delay": 0.1, "passivity": "tdpa", "bandwidth": 200.0})
    places, references = [], []
    for tick in range(1500):
        reference = link.sample(tick / 1e3, np.zeros(layout.dim))
        assert reference is not None
        places.append(link.device_motion.position)
        references.append(reference.position)
    error = layout.difference(np.array(references[400:]), np.array(places[300:-100]))
    moved = layout.difference(np.array(places[400:]), np.array(places[300:-100]))
    assert np.abs(error).max() < 0.02 * np.abs(moved).max()


def test_equal_links_give_bit_equal_references() -> None:
    """Delays and losses come from the seed alone."""
    link = {"delay": 0.05, "jitter": 0.3, "loss": 0.1}

    def run(**more: Any) -> list[float]:
        found = linked(link=link | more)
        positions = []
        for tick in range(400):
            reference = found.sample(tick / 1e3, np.array([np.sin(0.05 * tick), 1.0]))
            assert reference is not None
            positions += reference.position.tolist()
        return positions

    assert run() == run()
    assert run() != run(seed=1)


def test_a_repeated_sample_of_a_link_is_the_same() -> None:
    """A repeated sample time moves nothing."""
    link = linked()
    first = link.sample(0.0)
    second = link.sample(0.001)
    assert link.sample(0.001) is second
    assert first is not second


def test_missed_samples_are_simulated_later() -> None:
    """A late sample in wall time simulates all ticks since the last one."""
    steady, late = linked(link={"delay": 0.02}), linked(link={"delay": 0.02})
    push = np.array([1.0, 0.0])
    late.sample(0.0, push)
    for tick in range(61):
        reference = steady.sample(tick / 1e3, push)
    caught_up = late.sample(0.06, push)
    assert reference is not None
    assert caught_up is not None
    np.testing.assert_array_equal(caught_up.position, reference.position)


def test_after_a_dropout_the_link_starts_at_the_device_with_the_remaining_energy() -> None:
    """An interruption does not renew the reserve; a reset does, as a new run."""
    link = linked(link={"delay": 0.05}, dropout_times=[0.2, 0.5])
    before = None
    for tick in range(700):
        reference = link.sample(tick / 1e3, np.array([5.0, 0.0]))
        assert (reference is None) == (200 <= tick < 500)
        if tick == 199:
            before = link.account
        if tick == 500:
            assert reference is link.device_motion
            assert link.account == before
    assert before is not None
    assert before.operator_in > 0.0
    again = link.sample(0.0)
    assert again is link.device_motion
    account = link.account
    assert account is not None
    assert account.operator_in == account.operator_out == 0.0


def test_repeated_interruptions_do_not_renew_the_reserve() -> None:
    """A yielding hand receives the reserve once; the account continues."""
    breaks = [edge for n in range(20) for edge in (0.1 + 0.2 * n, 0.12 + 0.2 * n)]
    link = linked(link={"reserve": 0.01}, dropout_times=breaks, motion="still")
    least = put_in = 0.0
    for tick in range(4000):
        along = link.device_motion.velocity if link.account else np.zeros(2)
        link.sample(tick / 1e3, 20.0 * np.sign(along + 1e-3))
        if account := link.account:
            least = min(least, account.operator_net)
            assert account.operator_in >= put_in
            put_in = account.operator_in
            assert account.operator_net >= -(0.01 + account.surprise) - 1e-9
    assert least < 0.0


def test_a_link_requires_a_hand_with_mass() -> None:
    """The error names the missing key."""
    with pytest.raises(ScenarioError, match=r"haptic\.hand_mass: found 0.*> 0"):
        linked(hand_mass=0.0)
