# SPDX-License-Identifier: Apache-2.0
"""Two Pandas in fast 6-D motion: what reaches the grasp, under each law and at each rate."""

from pathlib import Path

import pytest

from noninteract_ros.analysis.compliance import COMPLIANCE, Errors, errors_table, measure_law
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario_file import find_scenario, load_scenario

DURATION = 2.0  # [s]; the fastest moment is at 1.8 s


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    """Two Pandas without an object."""
    return load_scenario(Path(find_scenario("dual_panda_free")))


@pytest.fixture(scope="module")
def at_1_khz(scenario: Scenario) -> Errors:
    """The motion under the noninteracting law at 1 kHz."""
    return measure_law(scenario, "noninteracting", 1000.0, DURATION)


def test_the_grasp_stays_within_1e_5_at_1_khz(at_1_khz):
    """At 0.5 m/s and 1 rad/s at once, with no limit of a joint in the way."""
    assert at_1_khz.speed == pytest.approx(0.5, rel=0.01)
    assert at_1_khz.turning == pytest.approx(1.0, rel=0.01)
    assert not at_1_khz.intervened
    assert at_1_khz.position["relative"] < 1e-5
    assert at_1_khz.angle["relative"] < 1e-5


def test_what_is_left_is_sampling_and_falls_with_the_rate(scenario, at_1_khz):
    """Of first order in the tick: half of it at twice the rate."""
    fast = measure_law(scenario, "noninteracting", 2000.0, DURATION)
    assert at_1_khz.position["relative"] / fast.position["relative"] == pytest.approx(2.0, abs=0.2)
    assert at_1_khz.angle["relative"] / fast.angle["relative"] == pytest.approx(2.0, abs=0.2)


def test_plain_compliance_lets_the_motion_reach_the_grasp(scenario):
    """With the same gains, softer ones that it bears, it errs a hundred times as much."""
    decoupled, plain = (
        measure_law(scenario, law, 1000.0, DURATION, 0.05)
        for law in ("noninteracting", COMPLIANCE)
    )
    assert plain.position["relative"] > 100.0 * decoupled.position["relative"]
    assert plain.angle["relative"] > 100.0 * decoupled.angle["relative"]
    assert errors_table([decoupled, plain]).row_count == 2
