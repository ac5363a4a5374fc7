# SPDX-License-Identifier: Apache-2.0
"""The delay experiment: unstable without the passivity layer, settled with it."""

import numpy as np
import pytest

from noninteract_ros.analysis import delay
from noninteract_ros.analysis.check import BUILT_IN, CheckSettings


def test_without_passivity_the_loop_is_stable_at_once_and_unstable_with_a_delay() -> None:
    """The same hand and wall: at rest without a delay, shaking at 50 ms, drawing energy."""
    still, shaking = (delay.run(delay.scenario("wall", d, "none"), 3.0) for d in (0.0, 0.05))
    assert still.restlessness < 0.02
    assert still.drawn < 0.01
    assert shaking.restlessness > 0.2
    assert shaking.drawn > 5.0


@pytest.mark.parametrize("place", ["wall", "carrying"])
def test_with_passivity_it_settles_and_no_more_than_the_reserve_is_drawn(place: str) -> None:
    """At 200 ms one way with jitter and losses the team gets where it is led."""
    found = delay.scenario(place, 0.2, "tdpa")
    kept = delay.run(found)
    assert kept.restlessness < 0.02
    assert kept.drawn <= delay.link_of(found).reserve + delay.SLACK
    assert kept.behind[-1] < (0.05 if place == "wall" else 0.002)
    force = np.linalg.norm(kept.feedback[-500:].mean(axis=0))  # The tremor is felt, too.
    assert (force > 3.0) if place == "wall" else (force < 0.1)


def test_the_table_has_a_row_for_each_cell_and_claims_for_what_is_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """`noninteract check delay`, made short."""
    monkeypatch.setattr(delay, "DELAYS", (0.05,))
    monkeypatch.setattr(delay, "PLACES", {"wall": {}})
    report = BUILT_IN["delay"](CheckSettings())
    (section,) = report.sections
    assert len(section.rows) == 1
    row = dict(zip(section.columns, section.rows[0], strict=True))
    assert row["without"] == "UNSTABLE"
    assert row["with"] == "settled"
    assert len(report.checks) == 3
    assert report.passed
