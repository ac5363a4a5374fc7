# SPDX-License-Identifier: Apache-2.0
"""Timing of the loop in wall time: late answers are reported, loops too slow are held."""

import numpy as np
import pytest
from harness import Ros, paper
from test_message_time import CODEC, WallController
from waiting import until

from noninteract_ros.nodes.common.loop_timing import MIN_ANSWERS, LoopTiming
from noninteract_ros.nodes.controller import supervision
from noninteract_ros.nodes.controller.supervision import LoopSupervision
from noninteract_ros.nodes.messages.messages import Level
from noninteract_ros.scenario import Scenario

MS = 10**6


def timing(rate: float, every: int, latency: float) -> LoopTiming:
    """Return the timing of a loop that answers every n-th state with a latency [s]."""
    result = LoopTiming(rate, 0.2)
    for i in range(2 * MIN_ANSWERS):
        result.record(round(i * every * 1e9 / rate), latency)
    return result


@pytest.mark.parametrize(
    ("every", "latency", "level", "share"),
    [(1, 0.0005, Level.OK, 100), (1, 0.0015, Level.ERROR, 0), (2, 0.0005, Level.ERROR, 50)],
)
def test_late_and_missing_answers_are_reported(
    every: int, latency: float, level: Level, share: int
) -> None:
    """Rate and share count states that were never answered."""
    loop = timing(1000.0, every, latency)
    values = loop.values()
    assert values["answered within the period [%]"] == pytest.approx(share)
    assert values["achieved rate [Hz]"] == pytest.approx(1000.0 / every)
    assert values["state to command, median [ms]"] == pytest.approx(1e3 * latency)
    assert loop.problem()[0] == level
    assert (f"{share} % of the states" in loop.problem()[1]) == (level != Level.OK)


def test_a_loop_too_slow_for_its_gains_is_held_with_hysteresis(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The reason has the measured rate; the hold ends after the loop has been stable."""
    monkeypatch.setattr(supervision, "RECOVERY_TIME", 0.0)
    scenario = Scenario.from_dict(paper(rate=1000.0))
    core = scenario.build_controller(scenario.team, scenario.stack)
    loop = LoopTiming(1000.0, 0.5)
    watch = LoopSupervision(scenario, core, loop)
    q = scenario.team.q0

    def run(every: int) -> None:
        loop.reset()
        for i in range(2 * MIN_ANSWERS):
            loop.record(i * every * MS, 0.0005)
        watch.check_rate(q)

    run(2)
    assert watch.overload == ""
    run(200)
    assert "the loop is too slow, 5 of 1000 Hz" in watch.overload
    run(180)
    assert watch.overload
    run(1)
    assert watch.overload == ""


def test_repeated_jumps_of_the_states_stop_the_team(ros: Ros) -> None:
    """The stop is latched, and the reason names the joint."""
    controller = WallController(ros)
    controller.expect_answer()
    side = [0]

    def stopped() -> bool:
        side[0] = 1 - side[0]
        q, zeros = np.array([0.3 + side[0], 0.4, -0.3, -0.4]), np.zeros(4)
        controller.states.publish(CODEC.encode(controller.now(), q, zeros, zeros))
        return controller.monitor.has_status("controller", "stopped: states jump repeatedly")()

    until(stopped, "the stop")
    assert "robot_1/x by" in controller.monitor.status["controller"][1]
    assert controller.node.core.mode.stopped
