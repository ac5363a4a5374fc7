# SPDX-License-Identifier: Apache-2.0
"""Channel of the link: delays, order and losses of packets."""

import numpy as np
import pytest

from noninteract_ros.sources.link.channel import Channel
from noninteract_ros.sources.link.settings import LinkSettings

PERIOD = 1e-3


def arrivals(settings: LinkSettings, count: int = 4000, direction: int = 0) -> dict[int, float]:
    """Return number and time of each arrival in order, for one packet per tick."""
    channel: Channel[int] = Channel(settings, direction)
    found = {}
    for tick in range(2 * count):
        now = tick * PERIOD
        if tick < count:
            channel.send(now, tick)
        found |= dict.fromkeys(channel.receive(now), now)
    return found


def test_without_delay_a_packet_arrives_at_once() -> None:
    """A packet arrives at the tick at which it was sent."""
    assert all(now == n * PERIOD for n, now in arrivals(LinkSettings()).items())


def test_delays_stay_within_their_spread_and_use_all_of_it() -> None:
    """Each packet takes delay (1 -+ jitter), and some come near both ends of the range."""
    found = arrivals(LinkSettings(delay=0.1, jitter=0.3))
    delays = np.array([now - n * PERIOD for n, now in found.items()])
    assert delays.min() >= 0.07 - 1e-9
    assert delays.max() <= 0.13 + PERIOD
    assert delays.min() < 0.072
    assert delays.max() > 0.128
    assert len(found) == 4000


def test_packets_overtake_each_other_only_where_they_may() -> None:
    """The order changes with reordering and is kept without it."""
    jitter = LinkSettings(delay=0.1, jitter=0.3)
    in_order = LinkSettings(delay=0.1, jitter=0.3, reordering=False)
    assert list(arrivals(jitter)) != sorted(arrivals(jitter))
    assert list(arrivals(in_order)) == sorted(arrivals(in_order))


def test_a_share_of_packets_is_lost() -> None:
    """5 % of 4000 are 200, within four standard deviations."""
    assert 4000 - len(arrivals(LinkSettings(loss=0.05))) == pytest.approx(200, abs=55)


def test_delay_and_loss_depend_on_seed_and_direction_alone() -> None:
    """Equal seeds give equal arrivals; other seeds or directions give others."""
    settings = LinkSettings(delay=0.05, jitter=0.3, loss=0.1, seed=3)
    assert arrivals(settings) == arrivals(settings)
    assert arrivals(settings) != arrivals(settings, direction=1)
    assert arrivals(settings) != arrivals(LinkSettings(delay=0.05, jitter=0.3, loss=0.1, seed=4))
