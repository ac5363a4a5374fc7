# SPDX-License-Identifier: Apache-2.0
"""Inputs of one source, by stamp."""

import numpy as np
import pytest

from noninteract_ros.control.references.inputs import HORIZON, Force, Rate, Source
from noninteract_ros.errors import InputError


def rate(value: float) -> Rate:
    return Rate(np.array([value]))


def test_inputs_are_valid_from_their_stamps_on():
    """An input is valid from its stamp until that of the next one, at any time of receipt."""
    source = Source()
    assert source.motion(10.0) is None
    for stamp in (1.0, 2.0, 2.5):
        source.receive(stamp, rate(stamp), now=2.0)
    assert source.motion(0.999) is None
    assert source.motion(1.0)[1].velocity == 1.0
    assert source.motion(1.9)[0] == 1.0
    assert source.motion(7.0)[0] == 2.5
    assert source.motion(8.0)[0] == 2.5


def test_of_one_stamp_the_last_counts():
    """Of two inputs with one stamp, the later one is valid."""
    source = Source()
    source.receive(1.0, rate(1.0), now=1.0)
    source.receive(1.0, rate(2.0), now=1.0)
    assert source.motion(1.0)[1].velocity == 2.0


@pytest.mark.parametrize("asked_for", [False, True])
def test_a_stamp_that_goes_back_is_rejected(asked_for):
    """An input older than the last one is rejected, whether that is pending or valid."""
    source = Source()
    source.receive(1.5, rate(1.0), now=1.0)
    if asked_for:
        source.motion(1.5)
    with pytest.raises(InputError, match=r"goes back: 1\.400000 s after 1\.500000 s"):
        source.receive(1.4, rate(2.0), now=1.0)
    assert source.motion(1.5)[1].velocity == 1.0


def test_a_stamp_far_ahead_is_rejected():
    """An input beyond the horizon is rejected and does not block later ones."""
    source = Source()
    with pytest.raises(InputError, match="ahead of the team's time"):
        source.receive(2.0 + HORIZON, rate(1.0), now=1.0)
    source.receive(1.2, rate(2.0), now=1.0)
    assert source.motion(1.2)[1].velocity == 2.0


def test_forces_and_motions_are_independent():
    """A force input leaves the motion valid, and has an order of stamps of its own."""
    source = Source()
    source.receive(1.0, rate(1.0), now=1.0)
    source.receive(0.5, Force(np.array([3.0])), now=1.0)
    assert source.motion(1.0)[0] == 1.0
    assert source.force(1.0)[1].force == 3.0


def test_markers_and_motions_set_complete_until():
    """`complete_until` is the latest stamp of a motion or marker; it never decreases."""
    source = Source()
    assert source.complete_until == -np.inf
    source.receive(1.0, rate(1.0), now=1.0)
    source.mark_complete_until(3.0)
    source.mark_complete_until(2.0)
    source.receive(1.5, rate(1.0), now=1.0)
    assert source.complete_until == 3.0


def test_discarding_inputs_keeps_complete_until():
    """After `discard_inputs` no input is valid and any stamp is accepted."""
    source = Source()
    source.receive(1.0, rate(1.0), now=1.0)
    source.receive(1.0, Force(np.array([3.0])), now=1.0)
    source.motion(1.0)
    source.discard_inputs()
    assert source.motion(9.0) is None
    assert source.force(9.0) is None
    assert source.complete_until == 1.0
    source.receive(0.5, rate(2.0), now=1.0)
    assert source.motion(1.0)[1].velocity == 2.0
