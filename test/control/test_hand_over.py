# SPDX-License-Identifier: Apache-2.0
"""Hand-overs during a motion: leading source, device force, and continuous torque."""

import numpy as np
import pytest
from repository import ROOT

from noninteract_ros.control.references.hand_over import HandOvers
from noninteract_ros.control.tick import Tick
from noninteract_ros.errors import ScenarioError
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import read_parameters
from noninteract_ros.scenario.rehearsal import Rehearsal

RELATIVE = slice(2, 4)


def run(**relative: object) -> list[Tick]:
    """Run the shipped scenario up to 6.7 s, with keys of the relative subtask changed."""
    values = read_parameters(ROOT / "config" / "hand_over.yaml")
    values["relative"] |= relative
    rehearsal = Rehearsal(Scenario.from_dict(values))
    return [rehearsal.step() for _ in range(6700)]


@pytest.fixture(scope="module")
def ticks() -> list[Tick]:
    return run()


def torque_rates(ticks: list[Tick]) -> np.ndarray:
    """Largest change of a torque per second at each tick [N/s]."""
    return 1000.0 * np.abs(np.diff([tick.torque for tick in ticks], axis=0)).max(axis=1)


def test_a_schedule_hands_over_once_at_each_of_its_times() -> None:
    """In between authority may be changed; after a reset the schedule starts over.

    Times count from the first state, as wall time has another origin.
    """
    plan = HandOvers([1.0, 2.0], ["human", "hold"], "relative")
    assert [plan.due(t) for t in (0.0, 0.999, 1.0, 1.5)] == [None, None, "human", None]
    assert plan.due(7.0) == "hold"
    assert plan.due(8.0) is None
    plan.reset()
    found = [plan.due(1.8e9 + t) for t in (0.0, 0.9, 1.0, 1.5, 2.0)]
    assert found == [None, None, "human", None, "hold"]


@pytest.mark.parametrize(
    ("times", "takers", "text"),
    [
        ([1.0, 1.0], ["human", "hold"], r"relative\.hand_over_times: .*increasing"),
        ([1.0], ["human", "hold"], r"relative\.hand_over_to: .*1 sources"),
    ],
)
def test_an_invalid_schedule_is_rejected(times: list[float], takers: list[str], text: str) -> None:
    """The error names the key."""
    with pytest.raises(ScenarioError, match=text):
        HandOvers(times, takers, "relative")


def test_authority_follows_the_schedule(ticks: list[Tick]) -> None:
    """Autonomy, from 2.5 s the human, from 6 s autonomy again, both during a motion."""
    led = [tick.led[1].source for tick in ticks]
    assert led[:2500] == ["autonomy"] * 2500
    assert led[2500:6000] == ["human"] * 3500
    assert set(led[6000:]) == {"autonomy"}
    for tick in (2500, 6000):
        assert np.linalg.norm(ticks[tick].led[1].reference.velocity) > 0.05


def test_the_human_squeezes_and_feels_it(ticks: list[Tick]) -> None:
    """The pair comes 5 cm closer, the device pushes back by more than 10 N; then it is over."""
    distance = [np.linalg.norm(tick.task.x[RELATIVE]) for tick in ticks]
    assert distance[0] == pytest.approx(0.5)
    assert distance[5400] < 0.45
    assert np.linalg.norm(ticks[5400].feedback[RELATIVE]) > 10.0
    assert distance[-1] == pytest.approx(0.5, abs=0.01)


def test_no_torque_steps_beyond_its_rate_limit(ticks: list[Tick]) -> None:
    """Through both hand-overs the torque rate stays far below the limit of 100 N/s."""
    assert torque_rates(ticks).max() < 40.0
    assert not any(tick.intervened for tick in ticks)


def test_a_direct_take_over_steps() -> None:
    """Only the shaping of the take-over keeps the limit: without it the limiter acts."""
    ticks = run(takeover="direct")
    assert any(tick.intervened for tick in ticks[2500:2600])
