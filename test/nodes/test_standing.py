# SPDX-License-Identifier: Apache-2.0
"""A team whose time stands: on purpose it is no error, without a purpose it is one."""

from typing import Any

import pytest
from harness import Ros, Stack, paper
from std_srvs.srv import SetBool, Trigger
from waiting import until

ERROR, WARN = 2, 1


def pause(ros: Ros, on: bool = True) -> None:
    assert ros.call(SetBool, "robot_team/pause", SetBool.Request(data=on)).success


def says(stack: Stack, level: int, text: str, older: float = 0.0) -> None:
    """Waits until the controller says so, of a state that is older than so much [s]."""

    def said() -> bool:
        found = stack.ear.status.get("controller")
        if found is None or float(found[2]["state age [s]"]) < older:
            return False
        return found[:2] == (level, text)

    until(said, repr(text))


@pytest.fixture(params=[True, False], ids=["lockstep", "wall time"])
def stack(request: pytest.FixtureRequest, ros: Ros) -> Stack:
    """A team that runs."""
    values: dict[str, Any] = paper(haptic=None, rate=100.0, lockstep=request.param, real_time=True)
    values["lockstep_sources"] = ["relative/autonomy"]
    found = ros.stack(values).begin()
    until(lambda: found.ear.says("controller", "holding cooperative")(), "the team runs")
    return found


def test_a_paused_team_is_no_error(ros: Ros, stack: Stack) -> None:
    """However long it takes; after it all goes on."""
    pause(ros)
    says(stack, WARN, "waiting: the team is paused", older=1.5)
    pause(ros, on=False)
    says(stack, WARN, "holding cooperative: source silent")


def test_a_stop_is_told_of_a_paused_team_too(ros: Ros, stack: Stack) -> None:
    """Else nobody would know that it has to be resumed."""
    pause(ros)
    assert ros.call(Trigger, "controller/stop").success
    says(stack, WARN, "stopped", older=1.5)


def test_a_team_that_is_gone_is_an_error_though_it_was_paused(ros: Ros, stack: Stack) -> None:
    """The word of a team that is not heard of any more counts no longer."""
    pause(ros)
    says(stack, WARN, "waiting: the team is paused")
    ros.remove(stack.nodes["robot_team"])
    says(stack, ERROR, "holding: no states from the team", older=1.0)


def test_a_team_that_has_finished_is_no_error(ros: Ros) -> None:
    """It came to the end that its scenario has."""
    stack = ros.stack(paper(end_time=0.2)).begin()
    says(stack, WARN, "waiting: the team has finished", older=1.5)
