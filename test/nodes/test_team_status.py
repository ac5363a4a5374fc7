# SPDX-License-Identifier: Apache-2.0
"""Teams without new states: paused and finished ones are no error, missing ones are."""

from typing import Any

import pytest
from harness import Ros, Stack, paper
from std_srvs.srv import SetBool, Trigger
from waiting import until

ERROR, WARN = 2, 1


def pause(ros: Ros, on: bool = True) -> None:
    assert ros.call(SetBool, "robot_team/pause", SetBool.Request(data=on)).success


def wait_for_status(stack: Stack, level: int, text: str, min_age: float = 0.0) -> None:
    """Wait for a status of the controller at a minimum age of the newest state [s]."""

    def reported() -> bool:
        status = stack.monitor.status.get("controller")
        if status is None or float(status[2]["state age [s]"]) < min_age:
            return False
        return status[:2] == (level, text)

    until(reported, repr(text))


@pytest.fixture(params=[True, False], ids=["lockstep", "wall time"])
def stack(request: pytest.FixtureRequest, ros: Ros) -> Stack:
    """Running team."""
    values: dict[str, Any] = paper(haptic=None, rate=100.0, lockstep=request.param, real_time=True)
    values["lockstep_sources"] = ["relative/autonomy"]
    running = ros.stack(values).start()
    running.monitor.wait_for_status("controller", "holding cooperative")
    return running


def test_a_paused_team_is_not_an_error(ros: Ros, stack: Stack) -> None:
    """It is a warning for as long as the pause lasts."""
    pause(ros)
    wait_for_status(stack, WARN, "waiting: the team is paused", min_age=1.5)
    pause(ros, on=False)
    wait_for_status(stack, WARN, "holding cooperative: source silent")


def test_a_stop_is_reported_for_a_paused_team(ros: Ros, stack: Stack) -> None:
    """Otherwise users would not know that the controller must be resumed."""
    pause(ros)
    assert ros.call(Trigger, "controller/stop").success
    wait_for_status(stack, WARN, "stopped", min_age=1.5)


def test_a_team_that_ends_while_paused_is_an_error(ros: Ros, stack: Stack) -> None:
    """The last status of a team without new diagnostics is ignored."""
    pause(ros)
    wait_for_status(stack, WARN, "waiting: the team is paused")
    ros.remove(stack.nodes["robot_team"])
    wait_for_status(stack, ERROR, "holding: no states from the team", min_age=1.0)


def test_a_finished_team_is_not_an_error(ros: Ros) -> None:
    """The team has reached `end_time`."""
    stack = ros.stack(paper(end_time=0.2)).start()
    wait_for_status(stack, WARN, "waiting: the team has finished", min_age=1.5)
